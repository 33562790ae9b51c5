"""Command `python -m lab peers`: simulate one drop in taichi-soft, in other engines and in a reference."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from lab.extras import how_to_install
from taichi_soft.cli.console import Arch, Threads, progress_bar, say
from taichi_soft.cli.filming import Fps, Out, Seconds, Size, size_of
from taichi_soft.core.checks import as_positive
from taichi_soft.core.runtime import init

SECONDS = 6.0
"""Default length of the film [s]."""


def peers(
    out: Out = None,
    seconds: Seconds = None,
    fps: Fps = 50.0,
    size: Size = "1280x720",
    video: Annotated[bool, typer.Option(help="Write a film; without, print the numbers only.")] = True,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Drop one body in taichi-soft, in a reference with fine steps, and in each installed engine.

    Print the cost and the error of each simulation, and film all of them side by side in slow motion.
    """
    from lab.peers import Drop, compare, missing_peers
    from lab.peers.wall import captions, film_wall
    from taichi_soft.render import VideoWriter

    path, pixels = (out or Path("out") / "peers.mp4") if video else None, size_of(size)
    length = as_positive(SECONDS if seconds is None else seconds, "seconds", "s")
    missing = missing_peers()
    if missing:
        say(escape(f"not installed here: {', '.join(missing)}: {how_to_install('peers')}"))
    init(arch, threads)
    drop, bar, frames = Drop(), progress_bar(), 0
    with (
        nullcontext() if path is None else VideoWriter(path, fps=fps, size=pixels) as writer,
        bar as progress,
    ):
        task = progress.add_task("", total=None)

        def show(name: str, done: int, total: int) -> None:
            progress.update(task, description=name, completed=done, total=total)

        entries = compare(drop, show)
        if writer:
            frames = film_wall(drop, entries, writer, seconds=length, on_frame=partial(show, "film"))
    if path is not None:
        say(f"wrote {escape(str(path))}: {frames} frames, {frames / fps:.1f} s")
    for entry in entries:
        step = f"steps of 1/{1 / entry.trajectory.step:.0f} s"
        say(escape("; ".join([*captions(entry), step])))
