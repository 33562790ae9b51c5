"""Errors against the mesh resolution (not in the thesis)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from lab.experiments.bar_stiffness import LINEAR, WIDTH, stiffness_over_theory
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Numbers,
    Plot,
    Point,
    Results,
    Section,
    Table,
)
from lab.experiments.judgement import judged_but_for

LENGTH = 2.0
LOADS = ("tension", "torsion", "bending")
"""Loads whose theoretical solution is exact up to the ends of the bar."""
SOLID, SPRINGS = "virial", "springs"
EXACT = 1e-3
"""Largest relative error in tension on any mesh. It is about as large as the strain."""
ORDERS = (1.5, 2.5)
"""Range of the expected order: linear tetrahedra are of second order in energy, and therefore in
stiffness."""


def points(effort: Effort) -> list[Point]:
    """List the points: each law and finite elements with 2 to 6 or 2 to 10 cells across."""
    counts = (6, 4, 3, 2) if effort is Effort.QUICK else (10, 8, 6, 4, 3, 2)  # later points reuse fields
    return [
        {"law": law, "strain": None, "cells": cells} for law in (SOLID, SPRINGS, LINEAR) for cells in counts
    ]


def measure(point: Point) -> Numbers:
    """Measure the relative error of the stiffness for each load."""
    numbers = stiffness_over_theory(point, LENGTH, LOADS)
    return {**numbers, **{load: numbers[load] - 1 for load in LOADS}}


def conclude(results: Results) -> Section:
    """Judge whether the errors fall with the square of the cell size."""
    order = (SOLID, SPRINGS, LINEAR).index
    ordered = sorted(results.rows, key=lambda row: (order(row.point["law"]), row.point["cells"]))
    results = Results(tuple(ordered))
    for row in ordered:
        results.one(**row.point)
    cells = [point["cells"] for point, _ in results.where(law=SOLID)]
    errors = {
        law: {load: [numbers[load] for _, numbers in results.where(law=law)] for load in LOADS}
        for law in (SOLID, SPRINGS, LINEAR)
    }
    orders = {
        (law, load): _order(cells, errors[law][load])
        for law in (SOLID, LINEAR)
        for load in ("torsion", "bending")
    }
    ours = {load: errors[SOLID][load] for load in LOADS}
    exact = {law: max(map(abs, errors[law]["tension"])) for law in (SOLID, SPRINGS)}
    shrinks = {
        law: exact[law] < EXACT and all(_falls(errors[law][load]) for load in ("torsion", "bending"))
        for law in (SOLID, SPRINGS)
    }
    in_order = all(ORDERS[0] < orders[SOLID, load] < ORDERS[1] for load in ("torsion", "bending"))
    agrees = shrinks[SOLID] and in_order
    springs = ", ".join(f"{load} {errors[SPRINGS][load][-1]:+.2f}" for load in LOADS)
    ends = {load: f"from {ours[load][0]:.2g} to {ours[load][-1]:.2g}" for load in ("torsion", "bending")}
    measured = (
        f"from {cells[0]} to {cells[-1]} cells across, errors of virial fall {ends['torsion']} in torsion "
        f"and {ends['bending']} in bending, with orders {orders[SOLID, 'torsion']:.2f} and "
        f"{orders[SOLID, 'bending']:.2f} (finite elements: {orders[LINEAR, 'torsion']:.2f} and "
        f"{orders[LINEAR, 'bending']:.2f}); in tension {exact[SOLID]:.1g} at most on any mesh. "
        f"Springs stay off ({springs} on the finest)"
    )
    worst = max(
        abs(a - b) for load in LOADS for a, b in zip(errors[SOLID][load], errors[LINEAR][load], strict=True)
    )
    cause = "model" if worst > EXACT else "mesh"
    why = f"{cause}: virial and finite elements on the same meshes are {worst:.1g} apart"

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        styles = {SOLID: "o-", SPRINGS: "s:", LINEAR: "o"}
        names = {LINEAR: "finite elements"}
        colours = {"tension": "C0", "torsion": "C1", "bending": "C2"}
        for law, by_load in errors.items():
            for load, values in by_load.items():
                if law == LINEAR and load == "tension":
                    continue  # exact up to round-off, far below the other curves
                of_order = f", order {orders[law, load]:.2f}" if (law, load) in orders else ""
                (line,) = axes.loglog(cells, np.abs(values), styles[law], color=colours[load], markersize=5)
                line.set_label(f"{names.get(law, law)}, {load}{of_order}")
                if law == LINEAR:  # rings, so that marks below stay visible
                    line.set(markersize=11, fillstyle="none")
        axes.loglog(cells, 2.0 * np.array(cells, float) ** -2, color="0.6", linewidth=1, label="order 2")
        axes.set_xticks(cells, [str(count) for count in cells])
        axes.minorticks_off()
        axes.set_xlabel("cells across the bar [1]")
        axes.set_ylabel("error of stiffness, over theory's [1]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper", frameon=False)

    rows = [(row.point, results.one(**row.point)) for row in results.rows]
    return Section(
        (
            f"A bar of {LENGTH:g} x {WIDTH:g} x {WIDTH:g} m in irregular Delaunay meshes of more and more "
            "cells, with loads for which theory is exact up to the ends (see beams): uniform tension, "
            "Saint-Venant's torsion, uniform bending. Linear tetrahedra reproduce the uniform stress of "
            "tension on any mesh. The remaining error there is of the size of the strain, 1e-4. In torsion "
            "and bending the error has the second order of the energy of linear elements, with virial as "
            "with scikit-fem.",
        ),
        (
            judged_but_for(
                "mesh-convergence",
                measured,
                agrees,
                why,
                [] if shrinks[SPRINGS] else [SPRINGS],
                "they go to another material than the one asked for",
            ),
        ),
        (
            Table(
                "errors",
                "Error of stiffness, over theory's",
                ("law", "cells across [1]", "vertices [1]", "tets [1]", *(f"{load} [1]" for load in LOADS)),
                tuple(
                    (
                        point["law"],
                        point["cells"],
                        numbers["vertices"],
                        numbers["tets"],
                        *(float(f"{numbers[load]:.3g}") for load in LOADS),
                    )
                    for point, numbers in rows
                ),
            ),
        ),
        (
            Plot(
                "errors",
                "Errors against the density of the mesh: virial and finite elements on the same meshes "
                "(rings), and springs, which go to another material.",
                draw,
                (8.0, 4.4),
            ),
        ),
    )


def _falls(errors: list[float]) -> bool:
    """True if each error is smaller than the previous error."""
    return all(abs(after) < abs(before) for before, after in pairwise(errors))


def _order(cells: list[int], errors: list[float]) -> float:
    """Return the slope of -log(error) over log(cells) by least squares; NaN if an error is zero."""
    sizes = np.log(np.array(cells, float))
    with np.errstate(divide="ignore"):
        logs = np.log(np.abs(errors))
    if not np.isfinite(logs).all():
        return float("nan")
    return float(-np.polyfit(sizes, logs, 1)[0])


CONVERGENCE = Experiment(
    "mesh-convergence",
    "Finer meshes",
    "beyond the thesis: linear elasticity",
    ("mesh-convergence",),
    points,
    measure,
    conclude,
)
"""The experiment on finer meshes."""
