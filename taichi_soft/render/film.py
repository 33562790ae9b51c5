"""Film a world: step it as a game loop does, draw each frame, and time the steps."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import LARGEST_COUNT, as_count, as_number, as_positive
from taichi_soft.core.errors import OptionError
from taichi_soft.render import Camera, VideoWriter
from taichi_soft.render.artist import Artist
from taichi_soft.render.camera_moves import Follow, Orbit
from taichi_soft.render.film_html import film_html
from taichi_soft.render.motion_blur import shutter_times
from taichi_soft.render.props import Prop, Scenery
from taichi_soft.render.stage import Actor, Stage
from taichi_soft.render.take import Take
from taichi_soft.world.warm_up import warm_up_step
from taichi_soft.world.world import context_of_world

__all__ = ["Actor", "Camera", "FilmReport", "Follow", "Orbit", "Prop", "Stage", "film"]

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class FilmReport:
    """Measurements of a film. Step times exclude drawing, writing and compiling.

    The compile time of kernels that only `Stage.act` calls counts as step time.
    """

    path: Path | None  # path of the film; None if nothing was written
    frames: int  # number of frames
    fps: float  # frames per second
    simulated: float  # simulated world time [s]
    step_times: NDArray[np.float64]  # time to step and read each frame except the first [s]
    draw_times: NDArray[np.float64]  # time to draw each frame [s]; empty if nothing is drawn
    slow: float = 1.0  # slow-motion factor of the film

    @property
    def real_time_factor(self) -> float:
        """Simulated time divided by the time spent on steps; 0 if the film has only one frame."""
        if len(self.step_times) == 0:
            return 0.0
        return float(len(self.step_times) / (self.fps * self.slow) / self.step_times.sum())

    def _repr_html_(self) -> str:
        """Return HTML for notebooks: the film and a table of its measurements."""
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
    slow: float = 1.0,
    blur: int = 1,
    stats: bool = False,
    on_frame: Progress | None = None,
) -> FilmReport:
    """Run a stage and write it to a film.

    Args:
        stage: stage to film; it continues from its current state.
        path: path of the film, see `VideoWriter`; None draws and writes nothing.
        fps: frames per second.
        size: width and height [pixels].
        seconds: world time to film [s]; None uses the stage's default.
        slow: slow-motion factor, 1 to 1000. The world makes the same steps; frames between two steps are
            interpolated linearly.
        blur: number of subframes to average in each frame, 1 to 64; 1 turns motion blur off.
        stats: True to also show the world's time [s] and the speed of this machine in each frame.
        on_frame: called with (frames made, total frames) after each frame.
    Raises: VideoError or OptionError. The arguments are checked before the world moves.
    """
    if not isinstance(stage, Stage):
        raise OptionError(f"stage must be a Stage, got {type(stage).__name__}")
    if not (on_frame is None or callable(on_frame)):
        raise OptionError(f"on_frame must be a function (frames made, total frames), got {on_frame!r}")
    length = as_positive(stage.seconds if seconds is None else seconds, "seconds", "s")
    # Frames per second of world time.
    rate = as_positive(fps, "fps", "1/s") * as_number(slow, "slow", 1.0, 1000.0)
    shots = as_count(blur, "blur", 1, 64)
    frames = length * rate
    if frames > LARGEST_COUNT:
        raise OptionError(f"seconds is {length:g} at {rate:g} per second: at most {LARGEST_COUNT:,} frames")
    count = max(1, round(frames))
    if 1.0 / rate > stage.step.dt * stage.step.max_steps:
        raise OptionError(
            f"fps is {fps:g}: a frame takes at most {stage.step.max_steps} steps of {stage.step.dt:g} s: use "
            f"{fps / (rate * stage.step.dt * stage.step.max_steps):g} or more"
        )
    start = stage.world.time
    scenery = Scenery(stage.world, stage.props, stage.collider_colors)
    take = Take(stage, scenery)
    take.play(0.0)
    take.camera()
    with nullcontext() if path is None else VideoWriter(path, fps=fps, size=size) as writer:
        artist = Artist(take, writer.size, rate, slow, stats) if writer else None
        _warm_up(stage, take, artist)
        for number in range(count):
            pictures = []
            # The first frame shows the initial state.
            for share in shutter_times(shots) if number else [0.0]:
                take.play(share / rate)
                if artist:
                    pictures.append(artist.draw())
            take.end_frame()
            if artist and writer:
                writer.write(artist.finish(pictures))
            if on_frame:
                on_frame(number + 1, count)
    return FilmReport(
        None if path is None else Path(path),
        count,
        fps,
        stage.world.time - start,
        np.array(take.times[1:]),
        np.array(artist.times if artist else []),
        float(slow),
    )


def _warm_up(stage: Stage, take: Take, artist: Artist | None) -> None:
    """Compile the kernels of steps and rendering without moving anything."""
    worlds = {id(world): world for world in [stage.world, *(a.world or stage.world for a in stage.actors)]}
    for world in worlds.values():
        warm_up_step(context_of_world(world))
    take.play(0.0)
    take.end_frame()
    take.times.clear()
    if artist:
        artist.finish([artist.draw()])
        artist.times.clear()
