"""Step a world frame by frame and record the meshes of its bodies."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from engine_adapter import EngineAdapter
from taichi_soft.bake.clip import Clip, Take
from taichi_soft.bodies.render_mesh import RenderMesh
from taichi_soft.bodies.skin_mesh import SkinMesh
from taichi_soft.core.errors import MeshError, OptionError, StateError
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

STEPS_PER_SECOND = 60.0
"""Smallest step rate of a world without an adapter [1/s]. It is the default rate of `FixedStep`."""

STEP_TOLERANCE = 1e-6
"""Largest relative deviation of the number of steps per frame from an integer. It covers rounding errors of
frame rates and step lengths."""

FRAME_TOLERANCE = 1e-3
"""Largest fraction of a frame by which a clip can end before the time of its last frame. For example, a clip
of 0.33333 s at 30 FPS has frames from 0 s to 1/3 s."""

Scene = World | EngineAdapter
Progress = Callable[[int, int], None]


def steps_of(scene: Scene, fps: float) -> Callable[[], None]:
    """Return a function that advances a scene by one frame. Frames coincide with steps, so that the bake
    contains exact states.

    Raises: OptionError if frames fall between the steps of an adapter.
    """
    if isinstance(scene, EngineAdapter):
        adapter, dt = scene, scene.fixed_step.dt
        count = round(1.0 / (fps * dt))
        if count < 1 or abs(1.0 / (fps * dt) - count) > STEP_TOLERANCE * count:
            rates = ", ".join(f"{1.0 / (n * dt):g}" for n in (1, 2, 3, 4))
            raise OptionError(
                f"fps is {fps:g}: frames fall between the adapter's steps of {dt:g} s: use {rates}, or a "
                f"FixedStep(dt=1 / {math.ceil(STEPS_PER_SECOND / fps) * fps:g})"
            )
        return lambda: _repeat(adapter.step, count)
    world, count = scene, max(1, math.ceil(STEPS_PER_SECOND / fps - STEP_TOLERANCE))
    return lambda: _repeat(lambda: world.step(1.0 / (fps * count)), count)


def record(
    scene: Scene,
    frame_count: int,
    fps: float,
    require_room: Callable[[int], object],
    on_frame: Progress | None = None,
) -> Take:
    """Step a scene and record every frame. The first frame is the current state.

    Args:
        scene: a built world, or the adapter that steps it.
        require_room: called with the number of vertices before the first frame and when bodies are added. It
            must raise an error if there are too many vertices.
        on_frame: called with (frames made, total frames) after each frame.
    Raises: StateError, which names the frame, for a body that is cut or torn during the recording; MeshError
        if no body has triangles; errors of `require_room` and of steps.
    """
    advance = steps_of(scene, fps)
    recorder = _Recorder(scene.world if isinstance(scene, EngineAdapter) else scene, fps, require_room)
    for frame in range(frame_count):
        if frame:
            advance()
        recorder.take(frame)
        if on_frame:
            on_frame(frame + 1, frame_count)
    clips = tuple(clip for _, clip in recorder.drawn)
    if not clips:
        raise MeshError(f"no body has triangles in any of the {frame_count} frames: add one with a surface")
    return Take(clips, frame_count, fps, tuple(recorder.left_out))


@dataclass
class _Recorder:
    """The clips of a running recording."""

    world: World
    fps: float
    require_room: Callable[[int], object]
    drawn: list[tuple[RenderMesh, Clip]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    known: set[Body] = field(default_factory=set)

    def take(self, frame: int) -> None:
        """Record the current mesh of each body as a frame."""
        there = set(self.world.bodies)
        self.known &= there  # a body that returns with a restored state starts a new clip
        new = [body for body in self.world.bodies if body not in self.known]
        for body in new:
            self._begin(body, frame)
        if new:
            self.require_room(sum(mesh.vertex_count for mesh, _ in self.drawn))
        for mesh, clip in self.drawn:
            if mesh.body in there and clip.end == frame:
                self._require_whole(mesh, clip, frame)
                clip.add(*self.world.read_render_mesh(mesh, 1.0))

    def _begin(self, body: Body, frame: int) -> None:
        self.known.add(body)
        meshes: tuple[RenderMesh, ...] = body.render_meshes
        try:
            meshes = meshes or (body.render_mesh(),)
        except MeshError:  # a body without triangles, such as a rope
            name = f"body {body.index}"
            self.left_out += [name] if name not in self.left_out else []
        for mesh in meshes:
            name = self._free_name(mesh, body)
            self.drawn.append((mesh, Clip(name, mesh.triangles, _visual(mesh), frame)))

    def _free_name(self, mesh: RenderMesh, body: Body) -> str:
        name = (mesh.name if isinstance(mesh, SkinMesh) else "") or f"body_{body.index}"
        taken = {clip.name for _, clip in self.drawn}
        others = (f"{name}_{number}" for number in range(2, len(taken) + 3))
        return name if name not in taken else next(each for each in others if each not in taken)

    def _require_whole(self, mesh: RenderMesh, clip: Clip, frame: int) -> None:
        if not mesh.is_outdated:
            return
        advice = "do that before the bake begins"
        if frame > 1:
            advice = f"bake only the time before it, {(frame - 1) / self.fps:.6g} seconds"
        raise StateError(
            f"{clip.name!r} was cut, torn or given another level of detail by frame {frame} "
            f"({frame / self.fps:.6g} s): a clip "
            f"cannot change its vertices: {advice}"
        )


def _visual(mesh: RenderMesh) -> Any:
    return mesh.visual if isinstance(mesh, SkinMesh) else None


def _repeat(call: Callable[[], object], count: int) -> None:
    for _ in range(count):
        call()


def frames_in(seconds: float, fps: float) -> int:
    """Return the number of frames from 0 to `seconds`, both included."""
    return math.floor(seconds * fps + FRAME_TOLERANCE) + 1
