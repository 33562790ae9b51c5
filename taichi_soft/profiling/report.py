"""Profiles as tables for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.table import Table

from taichi_soft.profiling.budget import Budget
from taichi_soft.profiling.comparison import Comparison
from taichi_soft.profiling.crossover import Crossover
from taichi_soft.profiling.spread import Spread


def tables(found: dict[str, Any]) -> Iterator[Table]:
    """One table for each measurement there is, under the keys of `taichi-soft profile --json`."""
    if "budget" in found:
        yield _phase_table(found["budget"])
        yield _budget_table(found["budget"])
    if "baseline" in found:
        yield _baseline_table(found["baseline"])
    if "crossover" in found:
        yield _crossover_table(found["crossover"])
    if "scaling" in found:
        table = _table("64 spheres on several threads", "substeps", "threads", "step [ms]", "speed-up")
        for row in found["scaling"]:
            table.add_row(str(row.substeps), str(row.threads), f"{row.step:.2f}", f"{row.speedup:.2f}")
        yield table
    if "startup" in found:
        table = _table("A new process to its first frame [s]", "kernel cache", "time")
        table.add_row("empty", f"{found['startup'][0].cold:.2f}")
        table.add_row("full", f"{found['startup'][0].warm:.2f}")
        yield table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column(columns[0])
    for name in columns[1:]:
        table.add_column(name, justify="right")
    return table


def _cells(spread: Spread, digits: int) -> list[str]:
    return [f"{value:.{digits}f}" for value in (spread.least, spread.median, spread.p99, spread.most)]


def _phase_table(budgets: list[Budget]) -> Table:
    measured = budgets[0].measured
    title = (
        f"{measured.bodies} spheres, {measured.tets:,} tetrahedra, {measured.substeps} substeps a frame [ms]"
    )
    table = _table(title, "", "least", "p50", "p99", "most")
    for name, spread in measured.phases.items():
        table.add_row(f"{name}, one thread", *_cells(spread, 3))
    table.add_row("read positions", *_cells(measured.read, 3))
    table.add_row("whole frame, all threads", *_cells(measured.frame, 3))
    table.add_row("Python and launches alone", *_cells(measured.python, 3))
    return table


def _budget_table(budgets: list[Budget]) -> Table:
    table = _table("What fits a frame at p99", "frame rate", "substeps", "bodies", "tetrahedra")
    for each in budgets:
        table.add_row(f"{each.rate} Hz", str(each.substeps), str(each.bodies), f"{each.tets:,}")
    return table


def _baseline_table(rows: list[Comparison]) -> Table:
    title = "Against plain C++ on one thread [ns per tetrahedron and substep, median]"
    return _ratio_table(title, ("Taichi", "C++"), [(r.tets, r.taichi, r.native, r.ratio) for r in rows])


def _crossover_table(rows: list[Crossover]) -> Table:
    title = "One body, flat against per_body [ns per tetrahedron and substep, median]"
    return _ratio_table(title, ("flat", "per_body"), [(r.tets, r.flat, r.per_body, r.ratio) for r in rows])


def _ratio_table(title: str, names: tuple[str, str], rows: list[tuple[int, Spread, Spread, Spread]]) -> Table:
    table = _table(title, "tetrahedra", *names, "ratio least", "ratio median", "ratio most")
    for tets, one, other, ratio in rows:
        ratios = [f"{x:.2f}" for x in (ratio.least, ratio.median, ratio.most)]
        table.add_row(f"{tets:,}", f"{one.median:.1f}", f"{other.median:.1f}", *ratios)
    return table
