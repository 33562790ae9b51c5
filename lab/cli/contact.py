"""Command `python -m lab contact`: run the scenes of contact and judge them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from taichi_soft.cli.console import Threads, console, progress_bar, say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init


def contact(
    names: Annotated[list[str] | None, typer.Argument(help="Scenes; all of them by default.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the table as a Markdown page to this file.")] = None,
    list_scenes: Annotated[bool, typer.Option("--list", help="List the scenes and end.")] = False,
    threads: Threads = None,
) -> None:
    """Run scenes of contact, such as crossed bars, ropes and heaps, and judge each by its criteria.

    The table shows what was measured, what is wanted, and the time of a step. What does not hold yet is shown
    as well.
    """
    from lab.contact import SCENES, run_scene
    from lab.contact.page import markdown, terminal

    if list_scenes:
        for scene in SCENES.values():
            say(escape(f"{scene.name}: {scene.title}"))
        return
    unknown = [name for name in names or () if name not in SCENES]
    if unknown:
        raise OptionError(f"unknown scene {unknown[0]!r}: choose from {', '.join(SCENES)}")
    init("cpu", threads)
    outcomes = []
    with progress_bar() as progress:
        for name in names or SCENES:
            task = progress.add_task(name, total=1.0)

            def show(done: float, task: int = task) -> None:
                progress.update(task, completed=done)  # type: ignore[arg-type]

            outcomes += run_scene(SCENES[name], show)
            progress.remove_task(task)
    console.print(terminal(outcomes))
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(markdown(outcomes), encoding="utf-8")
        say(f"wrote {escape(str(out))}")
