"""Options and output of commands that make a film."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from taichi_soft.cli.console import filming, say
from taichi_soft.core.errors import OptionError

if TYPE_CHECKING:
    from taichi_soft.render.stage import Stage

Out = Annotated[Path | None, typer.Option(help="Film to write: .mp4, .webm, .gif, or .png for images.")]
Seconds = Annotated[float | None, typer.Option(help="World time to film [s].")]
Fps = Annotated[float, typer.Option(help="Frames per second.")]
Size = Annotated[str, typer.Option(help="Width x height in pixels.")]
Slow = Annotated[float, typer.Option(help="Slow-motion factor.")]
Blur = Annotated[int, typer.Option(help="Subframes averaged per frame, for motion blur; 1 turns it off.")]

Stats = Annotated[
    bool, typer.Option("--stats", help="Show the time and the speed of this machine on each frame.")
]


def size_of(text: str) -> tuple[int, int]:
    """Parse text such as `1280x720`. Returns: width and height [pixels]. Raises: OptionError."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise OptionError(f"size must be width x height in pixels, such as 1280x720, got {text!r}")
    return int(width), int(height)


def make_film(
    name: str,
    make_stage: Callable[[], Stage],
    path: Path | None,
    *,
    size: tuple[int, int],
    seconds: float | None,
    fps: float,
    slow: float,
    blur: int,
    stats: bool,
) -> None:
    """Film a stage, and print the result and the speed. Without a path, only run the stage."""
    from taichi_soft.render.film import film

    with filming(name) as show:
        report = film(
            make_stage(),
            path,
            fps=fps,
            size=size,
            seconds=seconds,
            slow=slow,
            blur=blur,
            stats=stats,
            on_frame=show,
        )
    if report.path is not None:
        say(f"wrote {escape(str(report.path))}: {report.frames} frames, {report.frames / fps:.1f} s")
    if len(report.step_times):
        frame = f"median {median(report.step_times) * 1e3:.2f} ms per frame of {1e3 / fps:.1f} ms"
        say(
            f"{escape(name)}: {report.simulated:.2f} s simulated, {frame}: "
            f"{report.real_time_factor:.1f} x real time"
        )
    if len(report.draw_times):
        drawing = f"{median(report.draw_times) * 1e3:.1f} ms to draw, at the median"
        say(f"a frame of {size[0]}x{size[1]} took {drawing}")
