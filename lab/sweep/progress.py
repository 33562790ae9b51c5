"""Show the progress of a sweep on the console."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LINE_EVERY = 30.0
"""Interval between progress lines if the console is not a terminal [s]."""


class Advance(Protocol):
    """Callback that reports one finished point of the group `name`."""

    def __call__(self, name: str) -> None: ...


@contextmanager
def show_progress(console: Console, total: int) -> Iterator[Advance]:
    """Show a progress bar in a terminal; elsewhere print a line every `LINE_EVERY` seconds."""
    columns: tuple[Any, ...] = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    bar = Progress(
        *columns,
        console=console,
        disable=not console.is_terminal,
        refresh_per_second=2,  # seldom, so that updates do not disturb timings
        speed_estimate_period=600,
    )
    with bar:
        task = bar.add_task("computing", total=total)
        done, said, start = 0, time.monotonic(), time.monotonic()

        def advance(name: str) -> None:
            nonlocal done, said
            done += 1
            bar.update(task, advance=1, description=name)
            now = time.monotonic()
            if not console.is_terminal and now > said + LINE_EVERY:
                left = (now - start) / done * (total - done)
                console.print(f"{done} of {total} points, about {left:.0f} s left", highlight=False)
                said = now

        yield advance
