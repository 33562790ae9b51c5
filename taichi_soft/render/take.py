"""Steps a stage frame by frame, as a game loop does, with a clock at its side."""

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
    """A stage that goes on, and where its bodies are drawn.

    Attributes:
        adapter: which steps the world.
        positions, normals: of each actor, float32 (n, 3); those of skins have normals of their own.
        times: that stepping and reading each frame took [s].
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
        """Go on by some time of the world [s], 0 to stay, and read where everything is."""
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
        """Note what the frame took."""
        self.times.append(self._spent)
        self._spent = 0.0

    def camera(self) -> Camera:
        """Where the stage is looked at from now. Raises: OptionError where it follows what is not drawn."""
        camera = self.stage.camera
        return camera if isinstance(camera, Camera) else camera.at(self.adapter.time, self._box_of)

    def _box_of(self, body: Body) -> NDArray[np.float64]:
        for actor, rows in zip(self.stage.actors, self.positions, strict=True):
            if actor.body is body:
                return np.array([rows.min(axis=0), rows.max(axis=0)], dtype=np.float64)
        raise OptionError("the camera follows a body that is no actor of the stage")


def skins_of(actor: Actor) -> tuple[SkinMesh, ...]:
    """What is drawn in place of its body's surface, unless that is painted."""
    return () if actor.paint else actor.body.render_meshes


def _vertex_count(actor: Actor) -> int:
    """Of what is drawn of it."""
    return sum(mesh.vertex_count for mesh in skins_of(actor)) or actor.body.vertex_count
