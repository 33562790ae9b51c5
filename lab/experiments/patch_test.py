"""Patch test: under uniform strain, an irregular body must have the uniform stress of Hooke's law."""

from __future__ import annotations

from typing import Any

import numpy as np

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
from lab.experiments.irregular import cube
from lab.experiments.judgement import Span, judged_but_for
from taichi_soft import LAWS, Material, internal_forces
from taichi_soft.meshing.arrays import FloatArray

TETRAHEDRAL = ("virial", "face", "st_venant_kirchhoff", "neo_hookean")
ALONG_EDGES = tuple(law for law in LAWS if law not in TETRAHEDRAL)
YOUNG, POISSON = 1e6, 0.3
STRAINS = (1e-4, 1e-3, 1e-2)  # largest entry of the strain
SMALL = 1e-3
"""A law passes only if its error at the smallest strain is below this fraction of the largest force."""
FALLS = 0.02
"""A law passes only if its error at the smallest strain is below this fraction of that at the largest strain.
An error of second order in the strain gives 0.01."""


def points(effort: Effort) -> list[Point]:
    """List the points: each law on one irregular mesh or on three, with random strains."""
    is_full = effort is Effort.FULL
    seeds, strains = (range(1, 4), 12) if is_full else (range(1, 2), 4)
    laws = (*TETRAHEDRAL, *(ALONG_EDGES if is_full else ALONG_EDGES[:2]))
    return [{"law": law, "seed": seed, "strains": strains} for law in laws for seed in seeds]


def measure(point: Point) -> Numbers:
    """Measure the largest errors of the forces over random strains of each size.

    Returns: "surface", largest difference from the forces of Hooke's stress on the surface at rest; "inside",
        largest force on an inner vertex, which should be zero. Both numbers are divided by the largest force
        of Hooke's stress.
    """
    mesh, rng = cube(3, point["seed"]), np.random.default_rng(point["seed"])
    material = Material(YOUNG, POISSON, 1000.0, damping_ratio=0.0)
    is_inside = np.ones(len(mesh.vertices), dtype=bool)
    is_inside[mesh.surface_vertices] = False
    surface, inside = [0.0] * len(STRAINS), [0.0] * len(STRAINS)
    for _ in range(point["strains"]):
        shape = rng.uniform(-1, 1, (3, 3))
        for row, amount in enumerate(STRAINS):
            strain = amount * (shape + shape.T) / 2 / np.abs(shape + shape.T).max() * 2
            forces = internal_forces(mesh, material, mesh.vertices @ (np.eye(3) + strain), law=point["law"])
            wanted = _pull_of(mesh.vertices, mesh.surface, _hooke(strain))
            scale = np.abs(wanted).max()
            surface[row] = max(surface[row], float(np.abs(forces - wanted)[~is_inside].max() / scale))
            inside[row] = max(inside[row], float(np.abs(forces[is_inside]).max() / scale))
    return {"surface": surface, "inside": inside}


def _hooke(strain: FloatArray) -> FloatArray:
    lame_lambda, mu = YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON), YOUNG / 2 / (1 + POISSON)
    return np.asarray(lame_lambda * np.trace(strain) * np.eye(3) + 2 * mu * strain)


def _pull_of(vertices: FloatArray, surface: Any, stress: FloatArray) -> FloatArray:
    """Return the internal forces on the vertices of a body under uniform stress, (n, 3) [N].

    Each surface triangle contributes a third of its force, directed inwards, to each of its vertices.
    """
    a, b, c = (vertices[surface[:, i]] for i in range(3))
    traction = np.cross(b - a, c - a) / 2 @ stress
    forces = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(forces, surface[:, i], -traction / 3)
    return forces


def conclude(results: Results) -> Section:
    """Judge whether the forces approach those of Hooke's law as the strain approaches zero."""
    worst = {}
    for law in (*TETRAHEDRAL, *ALONG_EDGES):
        rows = [numbers for _, numbers in results.where(law=law)]
        if rows or law in TETRAHEDRAL:
            rows = rows or [results.one(law=law)]
            both = [np.maximum(n["surface"], n["inside"]) for n in rows]
            worst[law] = (np.max(both, axis=0), max(n["inside"][0] for n in rows))
    passed = {law: error[0] < min(SMALL, FALLS * error[2]) for law, (error, _) in worst.items()}
    smallest = max(float(worst[law][0][0]) for law in TETRAHEDRAL)
    others = [found for law, found in worst.items() if law not in TETRAHEDRAL]
    anywhere, inside = Span([error[0] for error, _ in others]), Span([within for _, within in others])
    broken = [law for law in TETRAHEDRAL if not passed[law]]

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for law, (error, _) in worst.items():
            axes.loglog(STRAINS, error, "o-" if law in TETRAHEDRAL else "s--", label=law, ms=3)
        axes.set_xlabel("strain [1]")
        axes.set_ylabel("error of forces, over the largest [1]")
        axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.02, 0.5))

    return Section(
        (
            "A cube of irregular tetrahedra is deformed uniformly, by random strains. Hooke's law then gives "
            "the same stress everywhere: no force on vertices inside, and on those of the surface a "
            "third of the force of the stress on each of their triangles.",
        ),
        (
            judged_but_for(
                "patch-test",
                f"at a strain of {STRAINS[0]:g} laws on tetrahedra miss the forces by {smallest:.1g} of the "
                f"largest, and the error falls with the strain; laws along edges miss them by {anywhere:.2g} "
                f"of it, and on vertices inside, where none should be, forces are {inside:.2g} of it",
                not broken,
                f"not so under {', '.join(broken)}",
                [law for law, has_passed in passed.items() if not has_passed],
                "under a uniform strain laws along edges have another stress than Hooke's",
            ),
        ),
        (
            Table(
                "errors",
                "Largest error of a force, over the largest force",
                ("law", *(f"at a strain of {strain:g} [1]" for strain in STRAINS)),
                tuple((law, *(float(e) for e in error)) for law, (error, _) in worst.items()),
            ),
        ),
        (Plot("errors", "What is left is of second order for laws on tetrahedra.", draw, (7.5, 4.0)),),
    )


PATCH_TEST = Experiment(
    "patch-test", "The patch test", "beyond the thesis", ("patch-test",), points, measure, conclude
)
"""The experiment with the patch test."""
