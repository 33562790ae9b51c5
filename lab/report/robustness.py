"""The sweep of `drop-test`: compute and store its cells, count the verdicts by law, and print the results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from lab.drop_test.robustness import GROUPS, Verdict, run_cell
from lab.drop_test.robustness.cell_run import CALM_TIME, DROP, DROP_TIME, MOST_WORK, RECOVERY_TIME
from lab.drop_test.robustness.cells import Cell
from lab.drop_test.robustness.verdict import MOST_SUBSTEPS, SHAPE_TOLERANCE, SPEED_TOLERANCE
from lab.experiments import Effort, Experiment, Result, Section
from lab.report.machine import machine_facts
from lab.report.markdown import escaped
from lab.report.run import run_experiments
from lab.sweep import origin
from taichi_soft.core.types import ArchName
from taichi_soft.meshing.delaunay import scipy_spatial

TIME_LIMIT = 600.0
"""Time limit of a cell [s]. A cell that exceeds the limit has no result and is retried."""

SOFT_MACH, SOFT_SAG = 0.5, 0.1
"""A printed line contains the Mach number of the impact if it exceeds `SOFT_MACH`, and the sag if it exceeds
`SOFT_SAG`. A body that hits the floor at its speed of sound is crushed."""

COLUMNS = (
    Verdict.OK,
    Verdict.FROZEN,
    Verdict.INVERTED,
    Verdict.RUNAWAY,
    Verdict.MISSHAPEN,
    Verdict.TOO_SOFT,
    Verdict.TOO_SLOW,
    Verdict.REFUSED,
    Verdict.NO_RESULT,
)

CRITERION = (
    "Every body is built with the options that its row names and with defaults for the rest. A dropped body "
    f"falls {DROP:g} m and is simulated for {DROP_TIME:g} s. A wreck is a body that starts strongly "
    f"deformed. Within {RECOVERY_TIME:g} s it must have no inverted tetrahedron for {CALM_TIME:g} s. Then "
    "gravity is switched off, and it comes to rest with strong damping. Frozen: the body reports it, or its "
    "positions are not finite. Inverted: inverted tetrahedra at the end. Runaway: at the end faster than "
    f"{SPEED_TOLERANCE:g} times the fastest speed of the fall. Misshapen: the distance from its rest shape "
    f"is more than {100 * SHAPE_TOLERANCE:g} % of its size, as a root mean square without rigid motion. Too "
    "soft: inverted, and the library warned that it cannot bear its own weight. Too slow, and not tried: "
    f"more than {MOST_SUBSTEPS} substeps for 1/60 s, or {MOST_WORK:.0e} substeps of tetrahedra in total. "
    "Refused: the library raised an error when it was built."
)


def run_sweep(
    cells: Sequence[Cell], folder: Path, console: Console, *, workers: int | None, arch: ArchName
) -> list[Result]:
    """Compute the cells that `folder` does not contain yet, and store each result immediately.

    Args:
        workers: number of processes; None for one per core.
    Raises: OptionError before anything is computed if scipy is needed and not installed; SweepError for files
        that do not belong to a sweep, or cannot be written.
    """
    groups = [name for name in (*GROUPS, "random wrecks") if any(cell["group"] == name for cell in cells)]
    if "foreign" in groups:
        scipy_spatial("foreign meshes")
    done = run_experiments(
        [_experiment(name, [cell for cell in cells if cell["group"] == name]) for name in groups],
        Effort.FULL,
        folder,
        console,
        workers=workers,
        arch=arch,
        time_limit=TIME_LIMIT,
    )
    return [row for _, results, _ in done for row in results.rows]


def _experiment(name: str, cells: list[Cell]) -> Experiment:
    return Experiment(
        name=name,
        title=f"Robustness: {name}",
        source="beyond the thesis",
        claims=(),
        points=lambda effort: cells,
        measure=run_cell,
        conclude=lambda results: Section((), ()),
    )


def verdict_of(row: Result) -> Verdict:
    """Return the verdict of a result."""
    return Verdict.NO_RESULT if row.numbers is None else Verdict(row.numbers["verdict"])


def is_broken(row: Result) -> bool:
    """True for a cell of the default law that is neither OK, too soft, too slow nor refused."""
    fine = (Verdict.OK, Verdict.TOO_SOFT, Verdict.TOO_SLOW, Verdict.REFUSED)
    return row.point["law"] is None and verdict_of(row) not in fine


def counts_by_law(rows: Sequence[Result]) -> dict[tuple[str, str, str, str], Counter[Verdict]]:
    """Count the verdicts of each group, law, flips and damping, in the order of the rows."""
    found: dict[tuple[str, str, str, str], Counter[Verdict]] = {}
    for row in rows:
        cell = row.point
        key = (cell["group"], cell["law"] or "default", cell["flips"] or "", cell["damping"])
        found.setdefault(key, Counter())[verdict_of(row)] += 1
    return found


def print_sweep(console: Console, rows: Sequence[Result], worst: int) -> None:
    """Print the first `worst` cells of each group and verdict that are not OK, and a table of counts."""
    grid = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for heading in ("group", "law", "flips", "damping"):
        grid.add_column(heading, no_wrap=True)
    for column in COLUMNS:
        grid.add_column(column.value, justify="right")
    last = ""
    for key, counted in counts_by_law(rows).items():
        if last and last != key[0]:
            grid.add_section()
        last = key[0]
        grid.add_row(*key, *(str(counted[column] or "") for column in COLUMNS))
    shown: Counter[tuple[str, Verdict]] = Counter()
    for row in _unwell(rows):
        kind = row.point["group"], verdict_of(row)
        shown[kind] += 1
        if shown[kind] <= worst:
            console.print(line_of(row), soft_wrap=True, highlight=False, markup=False)
    Console(file=console.file, width=max(console.width, 150)).print(grid)


def _unwell(rows: Sequence[Result]) -> list[Result]:
    """Return the cells of the default law that are not OK.

    If no cell has the default law, return the cells of all laws that are not OK.
    """
    unwell = [row for row in rows if verdict_of(row) is not Verdict.OK]
    if any(row.point["law"] is None for row in rows):
        return [row for row in unwell if row.point["law"] is None]
    return unwell


def line_of(row: Result) -> str:
    """Format a cell, its verdict and its reason in one line."""
    cell, numbers = row.point, row.numbers or {}
    law = " ".join(word for word in (cell["law"] or "default", cell["flips"], cell["damping"]) if word)
    reason = numbers.get("reason", row.error)
    line = f"{verdict_of(row).value}: {cell['group']}, {cell['name']} ({law}): {reason}"
    soft = []
    if cell["wreck"] is None and numbers.get("mach", 0.0) > SOFT_MACH:
        soft.append(f"hits the floor at Mach {numbers['mach']:.2g}")
    if numbers.get("sag", 0.0) > SOFT_SAG:
        soft.append(f"its own weight is worth a strain of {numbers['sag']:.2g}")
    return f"{line} [{', '.join(soft)}]" if soft else line


def write_page(rows: Sequence[Result], path: Path, command: str, arch: ArchName) -> None:
    """Write the table of counts, the cells that are not OK and the meshes as Markdown. Raises: OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(_page(rows, command, arch)) + "\n", encoding="utf-8")


def _page(rows: Sequence[Result], command: str, arch: ArchName) -> Iterator[str]:
    facts = machine_facts(arch)
    yield "# Which bodies stay whole"
    yield ""
    yield (
        f"Made on {date.today().isoformat()} by `{command}`, version {facts['taichi-soft']} of the sources "
        f"{origin(arch)['sources'][:12]}, Taichi {facts['taichi']}, {facts['processor']}."
    )
    yield ""
    yield CRITERION
    yield ""
    yield "## By law"
    yield ""
    headings = ["group", "law", "flips", "damping", *(column.value for column in COLUMNS)]
    keyed = counts_by_law(rows).items()
    yield from _table(
        headings, 4, [[*key, *(counted[each] or "" for each in COLUMNS)] for key, counted in keyed]
    )
    unwell = _unwell(rows)
    if unwell:
        yield "## Failures"
        yield ""
        yield from (f"- {escaped(line_of(row))}" for row in unwell)
        yield ""
    yield "## Meshes"
    yield ""
    yield "Facts of each mesh from its first body. Substeps are those of 1/60 s that the library chose."
    yield ""
    yield from _table(
        ["group", "mesh", "tetrahedra", "smallest dihedral angle", "substeps"], 2, _meshes(rows)
    )


def _meshes(rows: Sequence[Result]) -> list[list[str | int]]:
    """Return the facts of each mesh, from its first cell."""
    found: dict[tuple[str, str, float], list[str | int]] = {}
    for row in rows:
        cell, numbers = row.point, row.numbers
        if numbers is not None and cell["group"] in ("own", "foreign", "wrecked"):
            angle = f"{numbers['min_dihedral']:.3g}"
            facts = [cell["group"], cell["mesh"], numbers["tets"], angle, numbers["substeps"] or ""]
            found.setdefault((cell["group"], cell["mesh"], cell["scale"]), facts)
    return list(found.values())


def _table(headings: Sequence[str], words: int, rows: Sequence[Sequence[object]]) -> Iterator[str]:
    """Yield the lines of a Markdown table. Columns after the first `words` columns contain numbers."""
    yield _line(headings)
    yield f"|{'---|' * words}{'---:|' * (len(headings) - words)}"
    yield from map(_line, rows)
    yield ""


def _line(cells: Sequence[object]) -> str:
    return f"| {' | '.join(map(escaped, cells))} |"
