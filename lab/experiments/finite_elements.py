"""Compare every law with an independent finite element code on the same mesh (not in the thesis)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.end_loads import EndLoad, held_ends
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Plot,
    Point,
    Results,
    Section,
    Table,
    Verdict,
)
from lab.experiments.irregular_block import irregular_block
from lab.experiments.judgement import judged_but_for
from lab.experiments.law_variants import is_tetrahedral, label, variants
from lab.experiments.linear_elasticity import FiniteElements
from lab.experiments.statics import StaticBody
from lab.experiments.stiffness_dots import draw_stiffness_dots
from taichi_soft import Material, TetMesh

YOUNG, DENSITY = 1e6, 1000.0
LENGTH, WIDTH = 4.0, 1.0
AGREEMENT = 0.01
"""Relative tolerance of stiffness and displacement. The strains of 1e-4 cause errors of a few hundredths of
this tolerance."""
BEAM = ("tension", "shear", "torsion", "bending")


def points(effort: Effort) -> list[Point]:
    """List the points: every law on a coarse mesh with nu = 0.3, or on a finer mesh with three nu."""
    cells, ratios = (2, (0.3,)) if effort is Effort.QUICK else (5, (0.0, 0.25, 0.4))
    return [{**variant, "poisson": nu, "cells": cells} for nu in ratios for variant in variants(effort)]


def measure(point: Point) -> Numbers:
    """Compare stiffness and displacement of a beam and a block with those of linear finite elements."""
    material = Material(YOUNG, point["poisson"], DENSITY, damping_ratio=0.0)
    beam = irregular_block(LENGTH, WIDTH, point["cells"])
    block = irregular_block(WIDTH, WIDTH, point["cells"])
    numbers = _compared(beam, held_ends(beam), material, point)
    numbers["block"] = _compared(block, {"shear": held_ends(block)["shear"]}, material, point)["shear"]
    numbers["vertices"], numbers["tets"] = len(beam.vertices), len(beam.tets)
    return numbers


def _compared(mesh: TetMesh, loads: dict[str, EndLoad], material: Material, point: Point) -> Numbers:
    body = StaticBody(mesh, material, point["law"], point["strain"])
    reference = FiniteElements(mesh, material)
    numbers = {}
    for name, load in loads.items():
        found = body.equilibrium(load.loading)
        stiffness, expected = reference.solve(load)
        numbers[name] = {
            "stiffness": load.stiffness(found),
            "reference": stiffness,
            "apart": float(np.abs(found.displacement - expected).max() / np.abs(expected).max()),
        }
    return numbers


def conclude(results: Results) -> Section:
    """Judge whether laws on tetrahedra agree with finite elements, and laws along edges do not."""
    rows = [(row.point, results.one(**row.point)) for row in results.rows]
    solid = [(point, numbers) for point, numbers in rows if is_tetrahedral(point["law"])]
    bonds = [numbers for point, numbers in rows if not is_tetrahedral(point["law"])]
    worst = max(abs(_ratio(numbers[load]) - 1) for _, numbers in solid for load in (*BEAM, "block"))
    apart = max(numbers[load]["apart"] for _, numbers in solid for load in (*BEAM, "block"))
    block_worst = max(abs(_ratio(numbers["block"]) - 1) for _, numbers in solid)
    others = [_ratio(numbers[load]) for numbers in bonds for load in BEAM]
    other_blocks = [_ratio(numbers["block"]) for numbers in bonds]
    other_names = [
        point["law"]
        for point, numbers in rows
        if not is_tetrahedral(point["law"]) and abs(_ratio(numbers["block"]) - 1) >= AGREEMENT
    ]
    shown_ratio = min((point["poisson"] for point, _ in rows), key=lambda nu: abs(nu - 0.3))
    first, numbers = solid[0]
    first_block = numbers["block"]
    shear = YOUNG / (2 * (1 + first["poisson"])) * WIDTH
    table_rows = tuple(
        (
            label(point),
            point["poisson"],
            *(round(_ratio(numbers[load]), 5) for load in (*BEAM, "block")),
            float(f"{max(numbers[load]['apart'] for load in BEAM):.2g}"),
        )
        for point, numbers in rows
    )
    shown = {
        label(p): {load: _ratio(n[load]) for load in BEAM} for p, n in rows if p["poisson"] == shown_ratio
    }

    def draw(figure: Any) -> None:
        draw_stiffness_dots(figure, shown, "linear finite elements on the same mesh", (0.2, 1.4))

    differs = _why(solid)
    return Section(
        (
            f"A beam of {LENGTH:g} x {WIDTH:g} x {WIDTH:g} m and a cube of {WIDTH:g} m (E = {YOUNG:g} Pa) "
            "are attached to plates at both ends. One plate is moved away, moved sideways or "
            "twisted, or both are tilted, by strains of 1e-4. Newton's method finds the equilibrium in "
            f"float64, without time stepping, on an irregular Delaunay mesh ({numbers['vertices']} vertices "
            f"and {numbers['tets']} tetrahedra of many directions). "
            "scikit-fem solves the same mesh: linear elasticity, linear displacements.",
            "Laws on tetrahedra have the tangent of linear finite elements at rest: at small strain, all of "
            "thesis chapter 6 is a finite element method. Laws along edges take their constants from the "
            "same E, and G = E / (2 (1 + nu)): k = E a / l (eq. 5.1), with the area a of each edge's face "
            "from the mesh (barycentric subfaces, or the Voronoi graph for cmpm). Nothing is fitted. A "
            "network of springs whose faces are perpendicular to their edges, with edges in all directions "
            "alike and a uniform deformation, has Young's modulus E / 2 and Poisson's ratio 1/4, whatever nu "
            "is requested. It is softer still if it does not deform uniformly.",
        ),
        (
            Finding(
                "finite-elements",
                f"tetrahedral laws are within {worst:.2g} of scikit-fem's stiffness and {apart:.2g} of its "
                f"largest displacement; laws along edges have {min(others):.2f} to {max(others):.2f} of the "
                "stiffness",
                Verdict.AGREES if max(worst, apart) < AGREEMENT else Verdict.DIFFERS,
                "" if max(worst, apart) < AGREEMENT else differs,
            ),
            judged_but_for(
                "block-shear",
                f"tetrahedral laws are within {block_worst:.2g} of scikit-fem (nu = {first['poisson']:g}: "
                f"{first_block['stiffness'] / shear:.3f} G A / L, since free sides bulge); laws along edges "
                f"have {min(other_blocks):.2f} to {max(other_blocks):.2f} of the stiffness",
                block_worst < AGREEMENT,
                differs,
                list(dict.fromkeys(other_names)),
                "laws along edges resist as another material",
            ),
        ),
        (
            Table(
                "stiffness",
                "Stiffness, over that of linear finite elements on the same mesh",
                (
                    "law",
                    "nu [1]",
                    *(f"{load} [1]" for load in BEAM),
                    "shear of a cube [1]",
                    "displacements apart, of the largest [1]",
                ),
                table_rows,
            ),
        ),
        (
            Plot(
                "stiffness",
                f"Stiffness of every law at nu = {shown_ratio:g} over that of finite elements on the same "
                "mesh. Tetrahedral laws lie on the line.",
                draw,
                (7.5, 5.2),
            ),
        ),
    )


def _ratio(numbers: Numbers) -> float:
    return float(numbers["stiffness"] / numbers["reference"])


def _why(solid: list[tuple[Point, Numbers]]) -> str:
    """Return the reason for a difference, with the name of the law that differs most.

    Both methods use the same mesh, so the model causes the difference.
    """
    furthest = max(solid, key=lambda row: max(abs(_ratio(row[1][load]) - 1) for load in (*BEAM, "block")))
    return f"model: mesh and material are the same in both; {label(furthest[0])} is furthest away"


FINITE_ELEMENTS = Experiment(
    "finite-elements",
    "Against finite elements",
    "beyond the thesis: linear elasticity",
    ("finite-elements", "block-shear"),
    points,
    measure,
    conclude,
)
"""The experiment that compares laws with finite elements."""
