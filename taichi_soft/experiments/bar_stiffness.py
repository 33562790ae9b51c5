"""Stiffness of a bar under loads of which theory knows the answer, by a law or by finite elements."""

from __future__ import annotations

from collections.abc import Sequence

from taichi_soft import Material
from taichi_soft.experiments.end_loads import free_ends, theory
from taichi_soft.experiments.experiment import Numbers, Point
from taichi_soft.experiments.irregular_block import irregular_block
from taichi_soft.experiments.linear_elasticity import FiniteElements
from taichi_soft.experiments.statics import StaticBody

YOUNG, POISSON, DENSITY, WIDTH = 1e6, 0.3, 1000.0, 1.0
LINEAR, QUADRATIC = "linear finite elements", "quadratic finite elements"
"""By scikit-fem, beside the names of laws."""


def stiffness_over_theory(point: Point, length: float, loads: Sequence[str]) -> Numbers:
    """Ratio by load, and the size of the mesh.

    Args:
        point: "law" (or `LINEAR`, `QUADRATIC`), "strain", and "cells" across the bar.
        length: of the bar [m].
        loads: of `free_ends`.
    """
    mesh = irregular_block(length, WIDTH, point["cells"])
    material = Material(YOUNG, POISSON, DENSITY)
    cases = free_ends(mesh)
    if point["law"] in (LINEAR, QUADRATIC):
        elements = FiniteElements(mesh, material, quadratic=point["law"] == QUADRATIC)
        found = {name: elements.solve(cases[name])[0] for name in loads}
    else:
        body = StaticBody(mesh, material, point["law"], point["strain"])
        found = {name: cases[name].stiffness(body.equilibrium(cases[name].loading)) for name in loads}
    expected = theory(YOUNG, POISSON, length, WIDTH)
    ratios = {name: found[name] / expected[name] for name in loads}
    return {**ratios, "vertices": len(mesh.vertices), "tets": len(mesh.tets)}
