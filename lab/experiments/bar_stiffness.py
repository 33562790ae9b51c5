"""Stiffness of a bar under loads with known solutions, for a law or finite elements."""

from __future__ import annotations

from collections.abc import Sequence

from lab.experiments.end_loads import free_ends, theory
from lab.experiments.experiment import Numbers, Point
from lab.experiments.irregular_block import irregular_block
from lab.experiments.linear_elasticity import FiniteElements
from lab.experiments.statics import StaticBody
from taichi_soft import Material

YOUNG, POISSON, DENSITY, WIDTH = 1e6, 0.3, 1000.0, 1.0
LINEAR, QUADRATIC = "linear finite elements", "quadratic finite elements"
"""Names of two types of finite elements of scikit-fem. A point contains one of them in place of a law."""


def stiffness_over_theory(point: Point, length: float, loads: Sequence[str]) -> Numbers:
    """Measure the ratio of a bar's stiffness to its theoretical stiffness.

    Args:
        point: has the keys "law" (a law, `LINEAR` or `QUADRATIC`), "strain" and "cells" (number of cells
            across the bar). If "drawn" is true, displacements are returned too.
        length: length of the bar [m].
        loads: names of loads of `free_ends`.
    Returns: the ratio for each load, by name; the numbers of "vertices" and "tets"; and "displacements" of
        the vertices for each load, (n, 3) [m].
    """
    mesh = irregular_block(length, WIDTH, point["cells"])
    material = Material(YOUNG, POISSON, DENSITY, damping_ratio=0.0)
    expected = theory(YOUNG, POISSON, length, WIDTH)
    cases = free_ends(mesh)
    numbers: Numbers = {"vertices": len(mesh.vertices), "tets": len(mesh.tets)}
    if point["law"] in (LINEAR, QUADRATIC):
        elements = FiniteElements(mesh, material, quadratic=point["law"] == QUADRATIC)
        return numbers | {name: elements.solve(cases[name])[0] / expected[name] for name in loads}
    body = StaticBody(mesh, material, point["law"], point["strain"])
    settled = {name: body.equilibrium(cases[name].loading) for name in loads}
    if point.get("drawn"):
        numbers["displacements"] = {
            name: found.displacement.round(8).tolist() for name, found in settled.items()
        }
    return numbers | {name: cases[name].stiffness(settled[name]) / expected[name] for name in loads}
