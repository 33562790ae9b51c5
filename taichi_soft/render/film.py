"""Films of a world: steps it as a game loop would, draws every frame, and times the steps."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.contact.collider import Collider
from taichi_soft.core.checks import LARGEST_COUNT, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.render import (
    PALETTE,
    Camera,
    ColorScale,
    Renderer,
    Surface,
    VideoWriter,
    draw_color_scale,
    draw_labels,
    draw_legend,
    draw_text,
)
from taichi_soft.render.colors import Color
from taichi_soft.render.film_html import film_html
from taichi_soft.render.props import Prop, Scenery
from taichi_soft.render.skin_looks import texture_picture, vertex_colors
from taichi_soft.render.texture import Texture
from taichi_soft.world.body import Body
from taichi_soft.world.warm_up import warm_up_step
from taichi_soft.world.world import World, context_of_world

Paint = Callable[[Body], NDArray[np.float32]]
Progress = Callable[[int, int], None]

_RECENT = 25
"""Frames of whose times the picture tells the median."""

LABEL_ROOM = 1.2
"""How far in front of the middle of a body its label stands, in half widths of the body at rest."""


@dataclass
class Actor:
    """A body and how it is drawn."""

    body: Body
    color: Color = PALETTE[0]
    paint: Paint | None = None  # vertex colours (n, 3) after the last step, instead of `color`
    label: str = ""  # on the floor in front of the body
    world: World | None = None  # that it lives in, where that is not the stage's
    shift: ArrayLike = (0.0, 0.0, 0.0)  # from where it is to where it is drawn, (3,) [m]


@dataclass
class Stage:
    """A built world, how it is stepped and how it is seen. Its colliders are drawn without being named.

    Words stand in the corners, and are short: they have to be legible in a film of 480 pixels.
    """

    title: str
    world: World
    actors: list[Actor]  # `act` may add pieces that fell off
    camera: Camera
    step: FixedStep
    seconds: float  # that a film of it shows
    act: Callable[[World], object] | None = None  # before every fixed step: moves colliders, grabs, throws
    props: list[Prop] = field(default_factory=list)
    caption: Callable[[], str] | None = None  # a further line in the corner, after the last step
    scale: ColorScale | None = None  # what the colours of bodies mean, shown as a bar
    legend: list[tuple[Color, str]] = field(default_factory=list)  # colours of bodies and what these are
    collider_colors: dict[Collider, Color] = field(default_factory=dict)  # of those that are to stand out


@dataclass(frozen=True)
class FilmReport:
    """What a film took. Drawing, writing and compiling are not part of the step times.

    What `Stage.act` alone calls compiles where it calls it first, in a film as in a game.
    """

    path: Path | None
    frames: int
    fps: float
    simulated: float  # time that passed in the world [s]
    step_times: NDArray[np.float64]  # of stepping and reading each frame but the first [s]
    draw_times: NDArray[np.float64]  # of drawing each frame [s]; empty where nothing is drawn

    @property
    def real_time_factor(self) -> float:
        """Simulated time over the time it took; 0 if too few frames were made to tell."""
        if len(self.step_times) == 0:
            return 0.0
        return float(len(self.step_times) / self.fps / self.step_times.sum())

    def _repr_html_(self) -> str:
        """What a notebook shows: the film, and what it took."""
        figures = {
            "film": f"{self.frames} frames, {self.frames / self.fps:.1f} s",
            "simulated": f"{self.simulated:.2f} s",
        }
        if len(self.step_times):
            milliseconds = float(np.median(self.step_times)) * 1e3
            figures["steps of a frame"] = f"{milliseconds:.2f} ms of {1e3 / self.fps:.1f} ms, at the median"
            figures["speed"] = f"{self.real_time_factor:.1f} x real time"
        if len(self.draw_times):
            figures["drawing of a frame"] = f"{float(np.median(self.draw_times)) * 1e3:.1f} ms, at the median"
        return film_html(self.path, figures)


def film(
    stage: Stage,
    path: str | Path | None,
    *,
    fps: float = 50.0,
    size: tuple[int, int] = (1280, 720),
    seconds: float | None = None,
    on_frame: Progress | None = None,
) -> FilmReport:
    """Run a stage and write what it shows.

    Args:
        stage: what to film; it goes on from where it stands.
        path: of the film, see `VideoWriter`; None draws and writes nothing.
        fps: frames per second.
        size: width and height [pixels].
        seconds: length [s]; None takes the stage's own.
        on_frame: called with (frames made, frames in all) after each.
    Raises: VideoError or OptionError, before anything moves where the arguments are wrong.
    """
    if not isinstance(stage, Stage):
        raise OptionError(f"stage must be a Stage, got {type(stage).__name__}")
    if not (on_frame is None or callable(on_frame)):
        raise OptionError(f"on_frame must be a function (frames made, frames in all), got {on_frame!r}")
    length = as_positive(stage.seconds if seconds is None else seconds, "seconds", "s")
    frames = length * as_positive(fps, "fps", "1/s")
    if frames > LARGEST_COUNT:
        raise OptionError(f"seconds is {length:g} at {fps:g} per second: at most {LARGEST_COUNT:,} frames")
    count = max(1, round(frames))
    if 1.0 / fps > stage.step.dt * stage.step.max_steps:
        raise OptionError(
            f"fps is {fps:g}: a frame takes at most {stage.step.max_steps} steps of {stage.step.dt:g} s: use "
            f"{1.0 / (stage.step.dt * stage.step.max_steps):g} or more"
        )
    start = stage.world.time
    scenery = Scenery(stage.world, stage.props, stage.collider_colors)
    take = _Take(stage, scenery, fps)
    with nullcontext() if path is None else VideoWriter(path, fps=fps, size=size) as writer:
        artist = _Artist(stage, scenery, writer.size, fps) if writer else None
        _warm_up(stage, take, artist)
        for number in range(count):
            positions = take.play(number)
            if artist and writer:
                writer.write(artist.draw(positions, take.normals, take.adapter, take.times))
            if on_frame:
                on_frame(number + 1, count)
    return FilmReport(
        None if path is None else Path(path),
        count,
        fps,
        stage.world.time - start,
        np.array(take.times[1:]),
        np.array(artist.times if artist else []),
    )


def _warm_up(stage: Stage, take: _Take, artist: _Artist | None) -> None:
    """Compile what steps and pictures need. Nothing moves."""
    worlds = {id(world): world for world in [stage.world, *(a.world or stage.world for a in stage.actors)]}
    for world in worlds.values():
        warm_up_step(context_of_world(world))
    positions = take.play(0)
    take.times.clear()
    if artist:
        artist.draw(positions, take.normals, take.adapter, take.times)
        artist.times.clear()


def speed_of(times: Sequence[float], fps: float) -> str:
    """How fast the last frames were, at the median: one of them may have been disturbed.

    Args:
        times: of stepping each frame [s]. The first shows the stage as it stands, and does not count.
    """
    recent = times[1:][-_RECENT:]
    if not recent:
        return ""
    factor = 1.0 / fps / float(np.median(recent))
    return f"{factor:.{0 if factor >= 10 else 1 if factor >= 0.1 else 2}f} x real time"


class _Take:
    """Steps a stage frame by frame, as a game loop does, with a clock at its side."""

    def __init__(self, stage: Stage, scenery: Scenery, fps: float) -> None:
        self.stage, self.scenery = stage, scenery
        self.adapter = EngineAdapter(stage.world, stage.step, before_step=self._before_step)
        self.fps = fps
        self.buffers: list[NDArray[np.float32]] = []
        self.normals: list[NDArray[np.float32]] = []
        self.times: list[float] = []

    def _before_step(self, world: World) -> None:
        self.scenery.remember()
        if self.stage.act:
            self.stage.act(world)

    def play(self, number: int) -> list[NDArray[np.float32]]:
        """Go on to frame `number`; the first shows the stage as it stands. Returns positions to draw."""
        start = time.perf_counter()
        if number > 0:
            self.adapter.advance(1.0 / self.fps)
        actors = self.stage.actors
        if [_vertex_count(actor) for actor in actors] != [len(buffer) for buffer in self.buffers]:
            self.buffers = [np.empty((_vertex_count(actor), 3), dtype=np.float32) for actor in actors]
            self.normals = [np.empty_like(buffer) for buffer in self.buffers]
        for actor, buffer, normals in zip(actors, self.buffers, self.normals, strict=True):
            world = actor.world or self.stage.world
            at = 0
            for mesh in _skins_of(actor):
                rows = slice(at, at + mesh.vertex_count)
                world.read_render_mesh(mesh, self.adapter.alpha, buffer[rows], normals[rows])
                at += mesh.vertex_count
            if at == 0:
                world.read_positions(actor.body, self.adapter.alpha, buffer)
            buffer += np.asarray(actor.shift, dtype=np.float32)
        self.times.append(time.perf_counter() - start)
        return self.buffers


def _skins_of(actor: Actor) -> tuple[SkinMesh, ...]:
    """What is drawn in place of its body's surface, unless that is painted."""
    return () if actor.paint else actor.body.render_meshes


def _vertex_count(actor: Actor) -> int:
    """Of what is drawn of it."""
    return sum(mesh.vertex_count for mesh in _skins_of(actor)) or actor.body.vertex_count


class _Artist:
    """Draws a stage and writes beside it what the steps cost."""

    def __init__(self, stage: Stage, scenery: Scenery, size: tuple[int, int], fps: float) -> None:
        self.stage, self.scenery = stage, scenery
        self.fps = fps
        self.renderer = Renderer(*size, camera=stage.camera, floor=stage.world.settings.floor)
        self.times: list[float] = []
        self.surfaces: dict[tuple[int, int], list[Surface]] = {}  # by actor and version of its topology
        self.textures: dict[int, tuple[Any, Texture]] = {}  # by picture, which is kept: its id stays its own

    def draw(
        self,
        positions: list[NDArray[np.float32]],
        normals: list[NDArray[np.float32]],
        now: EngineAdapter,
        step_times: list[float],
    ) -> NDArray[np.uint8]:
        """The picture of the bodies at `positions`, where they are `now`; `normals` are those of skins."""
        start = time.perf_counter()
        surfaces = self.scenery.at(now.alpha).copy()
        for actor, rows, own in zip(self.stage.actors, positions, normals, strict=True):
            at = 0
            for surface in self._surfaces_of(actor):
                its = slice(at, at + surface.vertex_count)
                at += surface.vertex_count
                surface.positions = rows[its]
                if surface.normals is not None:
                    surface.normals = own[its]
                if actor.paint:
                    surface.color = actor.paint(actor.body)
                surfaces.append(surface)
        picture = self.renderer.render(surfaces)
        self._draw_labels(picture, positions)
        lines = [self.stage.title, f"t = {now.time:.2f} s   {speed_of(step_times, self.fps)}".rstrip()]
        if self.stage.caption:
            lines.append(self.stage.caption())
        draw_text(picture, lines)
        if self.stage.scale:
            draw_color_scale(picture, self.stage.scale, corner="top right")
        if self.stage.legend:
            draw_legend(picture, self.stage.legend, corner="top right")
        self.times.append(time.perf_counter() - start)
        return picture

    def _surfaces_of(self, actor: Actor) -> list[Surface]:
        """Its skins, or else its surface, made anew where a cut has changed it."""
        key = id(actor), actor.body.topology_version
        if key not in self.surfaces:
            skins = [self._skin_surface(mesh, actor.color) for mesh in _skins_of(actor)]
            self.surfaces[key] = skins or [Surface.of(actor.body.mesh, color=actor.color)]
        return self.surfaces[key]

    def _skin_surface(self, mesh: SkinMesh, color: Color) -> Surface:
        """In its own colours and texture where it has any."""
        picture, texture = texture_picture(mesh.visual, mesh.vertex_count), None
        if picture is not None:
            if id(picture) not in self.textures:
                self.textures[id(picture)] = picture, Texture(np.asarray(picture.convert("RGB")))
            texture = self.textures[id(picture)][1]
        nowhere = np.zeros((mesh.vertex_count, 3), dtype=np.float32)
        return Surface(
            nowhere,
            mesh.triangles,
            color=vertex_colors(mesh.visual, mesh.vertex_count, color),
            normals=nowhere,
            texture=texture,
            uv=None if texture is None else mesh.visual.uv,
        )

    def _draw_labels(self, picture: NDArray[np.uint8], positions: list[NDArray[np.float32]]) -> None:
        """A caption on the floor in front of each body that has one, clear of it."""
        named = [(a, rows) for a, rows in zip(self.stage.actors, positions, strict=True) if a.label]
        if not named:
            return
        floor = self.stage.world.settings.floor
        forward = np.subtract(self.stage.camera.eye, self.stage.camera.target)[:2]
        forward = forward / max(float(np.linalg.norm(forward)), 1e-9)
        feet = np.array([rows.mean(axis=0) for _, rows in named], dtype=np.float64)
        for foot, (actor, rows) in zip(feet, named, strict=True):
            half = float(np.ptp(actor.body.mesh.vertices, axis=0)[:2].max()) / 2
            foot[:2] += LABEL_ROOM * half * forward
            foot[2] = rows[:, 2].min() if floor is None else floor
        places = self.stage.camera.project(feet, self.renderer.width, self.renderer.height)
        draw_labels(picture, [actor.label for actor, _ in named], places)
