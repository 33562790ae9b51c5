"""Command `python -m lab drop-test`: run random drops, or a sweep over meshes, materials and laws."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from rich.markup import escape

from taichi_soft.cli.console import Arch, AsJson, Threads, console, errors, progress_bar, say
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init
from taichi_soft.core.types import ArchName, FlipsName, LawName


def drop_test(
    cases: Annotated[
        int | None,
        typer.Option(
            min=1, max=100_000, help="Number of random cases, 1000 by default; in a sweep, of each group."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")] = 0,
    first: Annotated[int, typer.Option(min=0, help="Number of the first case, to repeat one.")] = 0,
    law: Annotated[
        str | None,
        typer.Option(help="Force law, virial by default. In a sweep: a law, or default; all by default."),
    ] = None,
    flips: Annotated[
        str | None, typer.Option(help="tolerant, recover or off; recover by default, if the law supports it.")
    ] = None,
    worst: Annotated[
        int, typer.Option(min=0, help="Failed cases to list of each kind; a page lists all.")
    ] = 5,
    sweep: Annotated[
        bool, typer.Option("--sweep", help="Instead, drop or deform one body at a time, by every law.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Group of a sweep: foreign, own, cells or wrecked; may be repeated."),
    ] = None,
    damping: Annotated[str | None, typer.Option(help="Damping of a sweep, by name; all by default.")] = None,
    wrecks: Annotated[
        int, typer.Option(min=0, max=100_000, help="Random deformed bodies to add to a sweep.")
    ] = 0,
    out: Annotated[
        Path, typer.Option(help="Markdown page of a sweep; its results are stored in out/sweep.")
    ] = Path("out/sweep/sweep.md"),
    workers: Annotated[
        int | None, typer.Option(min=1, max=256, help="Processes of a sweep; one per core by default.")
    ] = None,
    as_json: AsJson = False,
    arch: Arch = "auto",
    threads: Threads = None,
) -> None:
    """Drop random bodies onto random courses and count the failures; exit code 1 if there are any.

    With --sweep: drop bodies of many meshes and materials onto a floor, and release strongly deformed ones,
    each with the default law and with every other law. An interrupted sweep resumes.
    """
    if not sweep and (only or damping or wrecks or workers):
        raise OptionError("--only, --damping, --wrecks and --workers are options of a sweep: add --sweep")
    if sweep:
        if seed or first or threads:
            raise OptionError("--seed, --first and --threads are options of random cases: leave out --sweep")
        asked = {"law": law, "flips": flips, "damping": damping, "count": cases, "wrecks": wrecks}
        _sweep(asked, only, out, worst, workers, arch, as_json=as_json)
        return
    init(arch, threads)
    from lab.drop_test import Summary, make_case, run_cases

    cases, law = cases or 1000, law or "virial"
    with progress_bar() as progress:
        numbers = range(first, first + cases)
        chosen = [
            make_case(seed, n, cast(LawName, law), cast(FlipsName, flips))
            for n in progress.track(numbers, description="making")
        ]
        outcomes = []
        for outcome in progress.track(run_cases(chosen), total=cases, description="dropping"):
            outcomes.append(outcome)
            if not errors.is_terminal and len(outcomes) % 50 == 0:
                errors.print(f"{len(outcomes)} of {cases} cases")
    summary = Summary(tuple(outcomes))
    if as_json:
        print(json.dumps(summary.rows(), indent=2))
    else:
        for line in summary.lines(worst):
            say(escape(line))
    if summary.failed:
        raise typer.Exit(1)


def _sweep(
    asked: dict[str, Any],
    groups: list[str] | None,
    out: Path,
    worst: int,
    workers: int | None,
    arch: ArchName,
    *,
    as_json: bool,
) -> None:
    from lab.drop_test.robustness import choose_cells
    from lab.report import robustness
    from lab.report.run import require_writable

    cells = choose_cells(groups or None, **asked)
    require_writable(out.parent)
    device = init(arch)
    rows = robustness.run_sweep(cells, Path("out") / "sweep", errors, workers=workers, arch=device.arch)
    robustness.write_page(rows, out, shlex.join(["python", "-m", "lab", *sys.argv[1:]]), device.arch)
    if as_json:
        print(json.dumps([{**row.point, **(row.numbers or {"reason": row.error})} for row in rows], indent=2))
    else:
        robustness.print_sweep(console, rows, worst)
        say(f"wrote {escape(str(out))}")
    if any(robustness.is_broken(row) for row in rows):
        raise typer.Exit(1)
