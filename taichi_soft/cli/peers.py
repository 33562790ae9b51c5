"""`taichi-soft demo compare --peers`: one drop here, in other engines and in a fine reference."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path

from rich.markup import escape

from taichi_soft.cli.console import progress_bar, say
from taichi_soft.core.checks import as_positive
from taichi_soft.core.runtime import init
from taichi_soft.core.types import ArchName

SECONDS = 6.0
"""Length of the film where none is given [s]."""


def film_peers(
    path: Path | None,
    seconds: float | None,
    fps: float,
    size: tuple[int, int],
    arch: ArchName,
    threads: int | None,
) -> None:
    """Simulate, write the film, and print a line for each engine; without a path no film."""
    from taichi_soft.lab.peers import Drop, compare, missing_peers
    from taichi_soft.lab.peers.wall import captions, film_wall
    from taichi_soft.render import VideoWriter

    length = as_positive(SECONDS if seconds is None else seconds, "seconds", "s")
    missing = missing_peers()
    if missing:
        say(escape(f"not installed here: {', '.join(missing)}: pip install 'taichi-soft[peers]'"))
    init(arch, threads)
    drop, bar, frames = Drop(), progress_bar(), 0
    with nullcontext() if path is None else VideoWriter(path, fps=fps, size=size) as writer, bar as progress:
        task = progress.add_task("", total=None)

        def show(name: str, done: int, total: int) -> None:
            progress.update(task, description=name, completed=done, total=total)

        entries = compare(drop, show)
        if writer:
            frames = film_wall(drop, entries, writer, seconds=length, on_frame=partial(show, "film"))
    if path is not None:
        say(f"wrote {escape(str(path))}: {frames} frames, {frames / fps:.1f} s")
    for entry in entries:
        step = f"steps of 1/{1 / entry.course.step:.0f} s"
        say(escape("; ".join([*captions(entry), step])))
