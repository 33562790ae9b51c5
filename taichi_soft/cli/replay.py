"""Command `replay`: replay a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, Threads, say
from taichi_soft.core.runtime import init


def replay(
    file: Annotated[
        Path, typer.Argument(help="A recording, see World(record=...), or a file saved by a web page.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Image of the final state, .png; by default next to the recording.")
    ] = None,
    steps: Annotated[int | None, typer.Option(help="Replay at most this many steps.")] = None,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Replay a recording bit-identically, print the first failure, and draw the final state."""
    init(arch, threads)
    from taichi_soft.render.replay import failure_line
    from taichi_soft.render.replay import replay as play_again

    report = play_again(file, out or file.with_suffix(".png"), steps)
    end = f"up to step {report.world.step_count}, t = {report.world.time:.4g} s"
    if report.first_difference is None:
        say(f"{report.steps} steps replayed, {end}: all states are bit-identical")
    else:
        say(
            f"{report.steps} steps replayed, {end}: states differ from step {report.first_difference} on. "
            "Was it recorded on another kind of processor?"
        )
    say(f"hash {report.hash}")
    for failure in report.failures:
        say(failure_line(failure))
    if not report.failures:
        say("no body is frozen")
    say(f"wrote {escape(str(report.picture))}")
    if report.first_difference is not None:
        raise typer.Exit(1)
