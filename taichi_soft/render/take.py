"""Step a stage frame by frame, as a game loop does, and time it."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from engine_adapter import EngineAdapter
from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.core.errors import OptionError
from taichi_soft.render.camera import Camera
from taichi_soft.render.props import Scenery
from taichi_soft.render.stage import Actor, Stage
from taichi_soft.world.body import Body
from taichi_soft.world.world import World


class Take:
    """A running stage, and the positions at which its bodies are drawn.

    Attributes:
        adapter: adapter that steps the world.
        positions, normals: one array per actor, float32 (n, 3), in m and as unit vectors. Normals are filled
            only for skins.
        times: time to step and read each frame [s].
    """

    def __init__(self, stage: Stage, scenery: Scenery) -> None:
        self.stage, self.scenery = stage, scenery
        self.adapter = EngineAdapter(stage.world, stage.step, before_step=self._before_step)
        self.positions: list[NDArray[np.float32]] = []
        self.normals: list[NDArray[np.float32]] = []
        self.times: list[float] = []
        self._spent = 0.0

    def _before_step(self, world: World) -> None:
        self.scenery.remember()
        if self.stage.act:
            self.stage.act(world)

    def play(self, seconds: float) -> None:
        """Advance the world by `seconds` of world time, which can be 0, and read all positions."""
        start = time.perf_counter()
        if seconds > 0.0:
            self.adapter.advance(seconds)
        actors = self.stage.actors
        if [_vertex_count(actor) for actor in actors] != [len(buffer) for buffer in self.positions]:
            self.positions = [np.empty((_vertex_count(actor), 3), dtype=np.float32) for actor in actors]
            self.normals = [np.empty_like(buffer) for buffer in self.positions]
        for actor, buffer, normals in zip(actors, self.positions, self.normals, strict=True):
            world = actor.world or self.stage.world
            at = 0
            for mesh in skins_of(actor):
                rows = slice(at, at + mesh.vertex_count)
                world.read_render_mesh(mesh, self.adapter.alpha, buffer[rows], normals[rows])
                at += mesh.vertex_count
            if at == 0:
                world.read_positions(actor.body, self.adapter.alpha, buffer)
            buffer += np.asarray(actor.shift, dtype=np.float32)
        self._spent += time.perf_counter() - start

    def end_frame(self) -> None:
        """Append the time spent on this frame to `times`."""
        self.times.append(self._spent)
        self._spent = 0.0

    def camera(self) -> Camera:
        """Return the current camera. Raises: OptionError if the camera follows a body that is not drawn."""
        camera = self.stage.camera
        return camera if isinstance(camera, Camera) else camera.at(self.adapter.time, self._box_of)

    def _box_of(self, body: Body) -> NDArray[np.float64]:
        for actor, rows in zip(self.stage.actors, self.positions, strict=True):
            if actor.body is body:
                return np.array([rows.min(axis=0), rows.max(axis=0)], dtype=np.float64)
        raise OptionError("the camera follows a body that is not an actor of the stage: add an Actor for it")


def skins_of(actor: Actor) -> tuple[SkinMesh, ...]:
    """Return the skins to draw instead of the body's surface. An actor with `paint` has no skins to draw."""
    return () if actor.paint else actor.body.render_meshes


def _vertex_count(actor: Actor) -> int:
    """Return the number of vertices that are drawn for an actor."""
    return sum(mesh.vertex_count for mesh in skins_of(actor)) or actor.body.vertex_count
