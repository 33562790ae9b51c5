"""Films of a world: steps it as a game loop would, draws every frame, and times the steps."""

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
    """What a film took. Drawing, writing and compiling are not part of the step times.

    What `Stage.act` alone calls compiles where it calls it first, in a film as in a game.
    """

    path: Path | None  # of the film; None where nothing was written
    frames: int  # number of frames
    fps: float  # frames per second
    simulated: float  # time that passed in the world [s]
    step_times: NDArray[np.float64]  # of stepping and reading each frame but the first [s]
    draw_times: NDArray[np.float64]  # of drawing each frame [s]; empty where nothing is drawn
    slow: float = 1.0  # by how much the film is slower than the world

    @property
    def real_time_factor(self) -> float:
        """Simulated time over the time it took; 0 if too few frames were made to tell."""
        if len(self.step_times) == 0:
            return 0.0
        return float(len(self.step_times) / (self.fps * self.slow) / self.step_times.sum())

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
    slow: float = 1.0,
    blur: int = 1,
    stats: bool = False,
    on_frame: Progress | None = None,
) -> FilmReport:
    """Run a stage and write what it shows.

    Args:
        stage: what to film; it goes on from where it stands.
        path: of the film, see `VideoWriter`; None draws and writes nothing.
        fps: frames per second.
        size: width and height [pixels].
        seconds: of the world that it shows [s]; None takes the stage's own.
        slow: how many times longer the film is than what it shows, 1 to 1000. The world makes the same steps;
            between two of them bodies are drawn on the straight way from one to the other.
        blur: how many pictures within the time of the shutter are averaged to one, 1 to 64; 1 is sharp.
        stats: write the time of the world [s] and the speed of this machine on each frame, too.
        on_frame: called with (frames made, frames in all) after each.
    Raises: VideoError or OptionError, before anything moves where the arguments are wrong.
    """
    if not isinstance(stage, Stage):
        raise OptionError(f"stage must be a Stage, got {type(stage).__name__}")
    if not (on_frame is None or callable(on_frame)):
        raise OptionError(f"on_frame must be a function (frames made, frames in all), got {on_frame!r}")
    length = as_positive(stage.seconds if seconds is None else seconds, "seconds", "s")
    rate = as_positive(fps, "fps", "1/s") * as_number(slow, "slow", 1.0, 1000.0)  # per second of the world
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
            # The first frame shows the stage as it stands.
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
    """Compile what steps and pictures need. Nothing moves."""
    worlds = {id(world): world for world in [stage.world, *(a.world or stage.world for a in stage.actors)]}
    for world in worlds.values():
        warm_up_step(context_of_world(world))
    take.play(0.0)
    take.end_frame()
    take.times.clear()
    if artist:
        artist.finish([artist.draw()])
        artist.times.clear()
