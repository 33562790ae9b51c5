"""Terminal output, options and device information, shared by all commands."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from taichi_soft.core.compilation import shown_by
from taichi_soft.core.runtime import Device
from taichi_soft.core.types import ArchName

console = Console()
errors = Console(stderr=True)

Arch = Annotated[ArchName, typer.Option(help="Device; auto is the CPU. vulkan and metal are untested.")]
Threads = Annotated[
    int | None, typer.Option(help="CPU threads; by default one per core, bound to it on Linux.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]


def say(line: str) -> None:
    """Print a line without wrapping it to the terminal's width."""
    console.print(line, soft_wrap=True, highlight=False)


def progress_bar() -> Progress:
    """Make a progress bar that is visible only on a terminal."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    return Progress(*columns, console=errors, disable=not errors.is_terminal)


@contextmanager
def filming(name: str) -> Iterator[Callable[[int, int], None]]:
    """Show the progress of a film and of compilation as a bar. Without a terminal, print only the name.

    Yields: a function to call with (frames made, total frames).
    """
    if not errors.is_terminal:
        say(f"filming {escape(name)}")
    label = escape(name)
    with progress_bar() as bar:
        task = bar.add_task(label, total=None)
        with shown_by(lambda text: bar.update(task, description=escape(text) or label)):
            yield lambda done, total: bar.update(task, description=label, completed=done, total=total)


def device_facts(device: Device) -> dict[str, Any]:
    """Return the chosen device, its thread count, its cores and the reason for the choice, by label."""
    facts = {"device": device.arch, "threads": device.threads, "chosen because": device.reason}
    return {**facts, "bound to cores": list(device.cores)} if device.cores else facts


def version_of(name: str) -> str:
    """Return the version of an installed package."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
