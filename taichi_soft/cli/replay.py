"""Recordings, made again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, say
from taichi_soft.core.runtime import init


def replay(
    file: Annotated[Path, typer.Argument(help="A recording, see World(record=...), or what a page saved.")],
    out: Annotated[
        Path | None, typer.Option(help="Picture of the end, .png; beside the recording by default.")
    ] = None,
    steps: Annotated[int | None, typer.Option(help="Makes at most this many of its steps.")] = None,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Make a recording again, bit by bit; say what broke first, and draw the moment."""
    init(arch, threads)
    from taichi_soft.render.replay import failure_line
    from taichi_soft.render.replay import replay as play_again

    report = play_again(file, out or file.with_suffix(".png"), steps)
    end = f"up to step {report.world.step_count}, t = {report.world.time:.4g} s"
    if report.first_difference is None:
        say(f"{report.steps} steps made again, {end}: every state is the same, bit by bit")
    else:
        say(
            f"{report.steps} steps made again, {end}: not the same from step {report.first_difference} on. "
            "Was it recorded on another kind of machine?"
        )
    say(f"hash {report.hash}")
    for failure in report.failures:
        say(failure_line(failure))
    if not report.failures:
        say("no body is frozen")
    say(f"wrote {escape(str(report.picture))}")
    if report.first_difference is not None:
        raise typer.Exit(1)
