"""Command `python -m lab contact`: run the scenes of contact and judge them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from engine_adapter import FixedStep
from taichi_soft.cli.console import Threads, console, progress_bar, say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init
from taichi_soft.world.world import World


def contact(
    names: Annotated[list[str] | None, typer.Argument(help="Scenes; all of them by default.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write the table as a Markdown page to this file.")] = None,
    list_scenes: Annotated[bool, typer.Option("--list", help="List the scenes and end.")] = False,
    encounters: Annotated[
        int, typer.Option(min=0, help="Instead of scenes, let this many random pairs of bodies meet.")
    ] = 0,
    films: Annotated[
        Path | None, typer.Option(help="Film the scenes into this folder instead of judging them.")
    ] = None,
    threads: Threads = None,
) -> None:
    """Run scenes of contact, such as crossed bars, ropes and heaps, and judge each by its criteria.

    The table shows what was measured, what is wanted, and the time of a step. What does not hold yet is shown
    as well.
    """
    if encounters:
        _run_encounters(encounters, threads)
        return
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
    if films is not None:
        _film(list(names or SCENES), films)
        return
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


def _run_encounters(count: int, threads: int | None) -> None:
    """Run random encounters, and print those that are not as physics requires."""
    from lab.contact.encounters import Arena

    init("cpu", threads)
    arena, good, met = Arena(), 0, 0
    with progress_bar() as progress:
        task = progress.add_task("encounters", total=float(count))
        for seed in range(count):
            found = arena.meet(seed)
            good, met = good + found.is_good, met + found.have_met
            if not found.is_good:
                progress.console.print(escape(repr(found)))
            progress.update(task, completed=float(seed + 1))
    say(f"{good} of {count} as physics requires; {met} met")


def _film(names: list[str], folder: Path) -> None:
    """Film scenes, one file each."""
    from lab.contact import SCENES
    from lab.contact.run import DT
    from taichi_soft.render.film import film
    from taichi_soft.render.stage import Stage

    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        scene = SCENES[name]
        stage = scene.make()
        if not stage.world.is_built:
            stage.world.build()
        act = stage.before_step

        def before_step(world: World, act: Callable[[float], None] | None = act) -> None:
            if act is not None:
                act(world.time)

        shown = Stage.of(
            stage.world, title=name, seconds=scene.seconds, step=FixedStep(dt=DT), act=before_step
        )
        path = folder / f"{name.replace(' ', '-').replace('/', '-')}.mp4"
        film(shown, path, size=(640, 360))
        say(f"wrote {escape(str(path))}")
