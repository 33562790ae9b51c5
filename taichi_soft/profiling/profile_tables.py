"""Format profiles as tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rich.table import Table

from taichi_soft.elements.laws import LAWS
from taichi_soft.elements.laws.law import ANISOTROPIC
from taichi_soft.profiling.budget import Budget
from taichi_soft.profiling.kept_budget import KeptBudget
from taichi_soft.profiling.law_costs import LawCost
from taichi_soft.profiling.phases import Phases
from taichi_soft.profiling.spread import Spread


def tables(found: dict[str, Any]) -> Iterator[tuple[str, Table]]:
    """Yield the title and the table of each measurement.

    Args:
        found: measurements, with the keys of `taichi-soft profile --json`.
    """
    if "budget" in found:
        measured = found["budget"][0].measured
        size = f"{measured.bodies} spheres, {measured.tets:,} tetrahedra"
        yield f"{size}, {measured.substeps} substeps per frame [ms]", _phase_table(measured)
        yield "What fits a frame at p99", _budget_table(found["budget"])
    if "baseline" in found:
        table = _table("law", "element", "tetrahedra", "Taichi", "C++", "ratio least", "median", "most")
        for r in found["baseline"]:
            times = f"{r.taichi.median:.1f}", f"{r.native.median:.1f}"
            table.add_row(r.law, r.element, f"{r.tets:,}", *times, *_ratios(r.ratio))
        yield "Against plain C++ on one thread [ns per element and substep, median]", table
    if "crossover" in found:
        rows = [(r.tets, r.flat, r.per_body, r.ratio) for r in found["crossover"]]
        yield (
            "One body, flat against per_body [ns per tetrahedron and substep, median]",
            _ratio_table(("flat", "per_body"), rows),
        )
    if "scaling" in found:
        table = _table("substeps", "threads", "one thread", "all threads", "least", "speed-up", "most")
        for row in found["scaling"]:
            times = f"{row.single.median:.2f}", f"{row.parallel.median:.2f}"
            table.add_row(str(row.substeps), str(row.threads), *times, *_ratios(row.speedup))
        yield "64 spheres on several threads [ms]", table
    if "devices" in found:
        table = _table("bodies", "tetrahedra", "CPU", "GPU", "gain least", "median", "most")
        for row in found["devices"]:
            times = f"{row.cpu.median:.2f}", f"{row.gpu.median:.2f}"
            table.add_row(str(row.bodies), f"{row.tets:,}", *times, *_ratios(row.gain))
        yield "A frame of 8 substeps without contact, positions read after it [ms, median]", table
    if "implicit" in found:
        table = _table("", "step [ms]", "other's", "ms per s", "other's", "gain least", "median", "most")
        for row in found["implicit"]:
            steps = f"{row.step * 1e3:.3g}", f"{row.other_step * 1e3:.3g}"
            times = f"{row.implicit.median:.0f}", f"{row.other.median:.0f}"
            table.add_row(row.name, *steps, *times, *_ratios(row.gain, 1))
        yield "Implicit Euler, time to simulate one second", table
    if "startup" in found:
        table = _table("world", "kernel cache", "first frame", "all warm")
        for row in found["startup"]:
            table.add_row(row.world, row.cache, f"{row.first_frame:.2f}", f"{row.warm:.2f}")
        yield "Start of a new process until its first frame, and until everything is compiled [s]", table
    if "features" in found:
        table = _table("a step with", "used", "least", "median", "most")
        for row in found["features"]:
            used = "yes" if row.is_used else "no"
            table.add_row(row.name, used, *_ratios(row.ratio))
        yield "Cost of features: step time over that of as many bodies in free fall", table
    if "heap" in found:
        table = _table("mesh", "tets", "step [ms]", "x real", "of free", "stolen")
        for row in found["heap"]:
            step, ratio = (" ".join(_ratios(spread)) for spread in (row.step, row.ratio))
            stolen = "?" if row.stolen is None else f"{row.stolen:.0%}"
            table.add_row(row.mesh, f"{row.tets:,}", step, f"{row.real_time:.2f}", ratio, stolen)
        bodies, threads = found["heap"][0].bodies, found["heap"][0].threads
        yield (
            f"{bodies} spheres in a pit, {threads} threads, 12 substeps for 1/60 s: least, median, most",
            table,
        )
    if "moments" in found:
        table = _table("", "least", "median", "p99", "most")
        for row in found["moments"]:
            table.add_row(row.name, *_cells(row.cost, 3))
        yield "What happens once", table
    if "kept_budget" in found:
        yield from _kept_budget_tables(found["kept_budget"])


def law_rows(costs: list[LawCost]) -> list[dict[str, Any]]:
    """Return a row for each law: parameters, energy conservation, source and cost."""
    rows = []
    for each in costs:
        law = LAWS[each.law]
        rows.append(
            {
                "law": law.name,
                "source": law.source,
                "parameters": ANISOTROPIC if each.is_anisotropic else law.parameters,
                "strain": each.strain,
                "flips": [choice.value for choice in law.flips],
                "keeps_energy": law.keeps_energy,
                "element": each.element,
                "cost": asdict(each.cost),
                "ratio": asdict(each.ratio),
            }
        )
    return rows


def law_table(costs: list[LawCost]) -> Table:
    """Make a table of `law_rows`, with median costs."""
    table = Table()
    for name in ("law", "source", "parameters", "strain", "flips", "energy", "element", "ns"):
        table.add_column(name, no_wrap=name == "law")
    table.add_column("of virial", justify="right")
    for row in law_rows(costs):
        table.add_row(
            row["law"],
            row["source"],
            ", ".join(row["parameters"]),
            row["strain"] or "-",
            ", ".join(row["flips"]) or "-",
            "kept" if row["keeps_energy"] else "drifts",
            row["element"],
            f"{row['cost']['median']:.1f}",
            f"{row['ratio']['median']:.2f}",
        )
    return table


def _table(*columns: str) -> Table:
    table = Table()
    table.add_column(columns[0])
    for name in columns[1:]:
        table.add_column(name, justify="right")
    return table


def _ratios(spread: Spread, digits: int = 2) -> list[str]:
    return [f"{x:.{digits}f}" for x in (spread.least, spread.median, spread.most)]


def _cells(spread: Spread, digits: int) -> list[str]:
    return [f"{value:.{digits}f}" for value in (spread.least, spread.median, spread.p99, spread.most)]


def _phase_table(measured: Phases) -> Table:
    table = _table("", "least", "p50", "p99", "most")
    for name, spread in measured.phases.items():
        table.add_row(f"{name}, one thread", *_cells(spread, 3))
    table.add_row("read positions", *_cells(measured.read, 3))
    table.add_row("whole frame, all threads", *_cells(measured.frame, 3))
    table.add_row("Python and launches alone", *_cells(measured.python, 3))
    return table


def _budget_table(budgets: list[Budget]) -> Table:
    table = _table("frame rate", "substeps", "bodies", "tetrahedra")
    for each in budgets:
        table.add_row(f"{each.rate} Hz", str(each.substeps), str(each.bodies), f"{each.tets:,}")
    return table


def _kept_budget_tables(runs: list[KeptBudget]) -> Iterator[tuple[str, Table]]:
    """Yield titles and tables of a budget. The columns are the three runs of `measure_kept_budget`."""
    names = ("with a budget" if run.is_kept else "its levels" if run.is_fixed else "without" for run in runs)
    table = _table("", *names)
    for name, attribute in (
        ("step", "step"),
        ("step, once it is met", "settled"),
        ("CPU time of a step", "work"),
        ("frame", "frame"),
        ("deciding, in a frame without a change", "deciding"),
        ("deciding and changing, in other frames", "changing"),
    ):
        table.add_row(name, *(_late_cells(getattr(run, attribute)) for run in runs))
    for name, value_of in (
        ("step: p99 over p50", lambda run: f"{run.step.p99 / run.step.median:.2f}"),
        ("the same, once it is met", lambda run: f"{run.settled.p99 / run.settled.median:.2f}"),
        ("steps over the budget", lambda run: f"{run.late:.1%}"),
        ("over the budget, once it is met", lambda run: f"{run.late_settled:.1%}"),
        ("met after steps", lambda run: "never" if run.met_after is None else str(run.met_after)),
        ("frames with changes", lambda run: str(run.frames_with_changes)),
        ("skipped steps of bodies", lambda run: f"{run.skipped:.1%}"),
        ("bodies at level", lambda run: ", ".join(f"{level}: {n}" for level, n in run.levels.items())),
        ("tetrahedra at the end", lambda run: f"{run.tets:,}"),
        ("non-finite bodies", lambda run: str(run.frozen)),
        ("stolen", lambda run: "?" if run.stolen is None else f"{run.stolen:.0%}"),
    ):
        table.add_row(name, *map(value_of, runs))
    bodies = sum(runs[0].levels.values())
    limit = f"a budget of {runs[0].budget:.2f} ms a step"
    yield f"{bodies} bodies with levels of detail, {limit}; times: p50, p99, most [ms]", table


def _late_cells(spread: Spread | None) -> str:
    return "-" if spread is None else f"{spread.median:.2f} {spread.p99:.2f} {spread.most:.2f}"


def _ratio_table(names: tuple[str, str], rows: list[tuple[int, Spread, Spread, Spread]]) -> Table:
    table = _table("tetrahedra", *names, "ratio least", "ratio median", "ratio most")
    for tets, one, other, ratio in rows:
        table.add_row(f"{tets:,}", f"{one.median:.1f}", f"{other.median:.1f}", *_ratios(ratio))
    return table
