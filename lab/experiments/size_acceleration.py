"""Accelerations of a body of twice the size under the same deformation (thesis section 6.6)."""

from __future__ import annotations

from itertools import pairwise
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
from lab.experiments.judgement import Span, judged
from taichi_soft import Material, TetMesh, internal_forces, sphere
from taichi_soft.core.types import LawName
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.world.bare import bare_world

LAWS: tuple[LawName, ...] = ("virial", "face")
MATERIAL = Material(1e6, 0.3, 1000.0, damping_ratio=0.0)
SIZES = (1.0, 2.0, 4.0)
THESIS_RATIO = 8.0
"""Acceleration of a body divided by that of a body of twice the size, according to the thesis."""
TOLERANCE = 0.1
"""Largest relative deviation from `THESIS_RATIO` that counts as agreement."""
STEP = 1e-6
"""Length of the step over which an acceleration is measured [s]. The step is so short that the body hardly
moves."""


def points(effort: Effort) -> list[Point]:
    """List the points: laws of chapter 6, with spheres of several sizes."""
    laws = LAWS[:1] if effort is Effort.QUICK else LAWS
    return [{"law": law, "size": size} for law in laws for size in SIZES]


def measure(point: Point) -> Numbers:
    """Measure the root mean squares of forces [N] and accelerations [m/s^2], and the mass [kg]."""
    mesh = _sphere(point["size"])
    stretched = mesh.vertices * (1.1, 1.0, 0.9)
    forces = internal_forces(mesh, MATERIAL, stretched, law=point["law"])
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, MATERIAL, law=point["law"])
    world.build()
    body.set_motion(stretched, np.zeros_like(stretched))
    world.step(STEP, 1)
    first = np.array(body.velocities(), dtype=np.float64)
    world.step(STEP, 1)  # measure the second step, because leapfrog's first is half a step
    accelerations = (np.array(body.velocities(), dtype=np.float64) - first) / STEP
    return {"force": _size(forces), "mass": float(body.masses.sum()), "acceleration": _size(accelerations)}


def _sphere(size: float) -> TetMesh:
    unit = sphere(1.0, 3)
    return TetMesh(size * unit.vertices, unit.tets)


def _size(rows: FloatArray) -> float:
    return float(np.sqrt((rows**2).sum(axis=1).mean()))


def conclude(results: Results) -> Section:
    """Judge the ratio of accelerations for twice the size."""
    laws = tuple(dict.fromkeys(point["law"] for point, _ in results.where()))
    found = {law: {size: results.one(law=law, size=size) for size in SIZES} for law in laws}
    ratios = {
        key: [n[small][key] / n[large][key] for n in found.values() for small, large in pairwise(SIZES)]
        for key in ("force", "mass", "acceleration")
    }
    forces, masses = (1 / float(np.mean(ratios[key])) for key in ("force", "mass"))

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        sizes = np.array(SIZES)
        for law, n in found.items():
            over = [n[size]["acceleration"] / n[SIZES[0]]["acceleration"] for size in SIZES]
            axes.loglog(sizes, over, "o-", label=law)
        axes.loglog(sizes, 1 / sizes, ":", color="black", label="1 / s")
        axes.loglog(sizes, sizes ** -np.log2(THESIS_RATIO), "--", color="grey", label="thesis: 1 / s^3")
        axes.set_xlabel("size s [1]")
        axes.set_ylabel("acceleration over that at s = 1 [1]")
        axes.legend()

    return Section(
        (
            "A sphere is stretched by 10 % along x and compressed by 10 % along z, and released. The "
            "accelerations are those of its particles in the first moment, for three sizes of the same mesh.",
        ),
        (
            judged(
                "size-acceleration",
                f"at twice the size accelerations are {Span(ratios['acceleration']):.3g} times smaller; "
                f"forces are {forces:.3g} times larger, masses {masses:.3g} times. Tolerance: "
                f"{THESIS_RATIO:g} within {TOLERANCE:.0%}",
                all(abs(ratio / THESIS_RATIO - 1) < TOLERANCE for ratio in ratios["acceleration"]),
                "the text takes the forces for the same in both bodies. A force is a stress times an area, "
                "and areas grow with the square of the size",
            ),
        ),
        (
            Table(
                "sizes",
                "The same deformation at several sizes",
                ("law", "size [1]", "force [N]", "mass [kg]", "acceleration [m/s^2]"),
                tuple(
                    (law, size, n["force"], n["mass"], n["acceleration"])
                    for law, rows in found.items()
                    for size, n in rows.items()
                ),
            ),
        ),
        (Plot("sizes", "Accelerations fall with the size, and not with its cube.", draw),),
    )


SIZE_ACCELERATION = Experiment(
    "size-acceleration",
    "Accelerations of a larger body",
    "section 6.6",
    ("size-acceleration",),
    points,
    measure,
    conclude,
)
"""The experiment on size and acceleration."""
