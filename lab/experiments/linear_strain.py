"""Error of the linearised strain of eq. 6.7 (thesis 6.1 and chapter 7)."""

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
from lab.experiments.judgement import judged
from taichi_soft import Material, TetMesh, internal_forces
from taichi_soft.core.types import StrainName
from taichi_soft.meshing.arrays import FloatArray

KINDS = ("stretch", "shear")
YOUNG = 1e6
TET = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]])
SMALL = 0.1
"""Largest strain that counts as small."""
CLOSE = 0.1
"""Largest relative error that counts as close."""


def points(effort: Effort) -> list[Point]:
    """List the points: both deformations, with strains up to 100 %."""
    steps = 100 if effort is Effort.FULL else 20
    return [{"kind": kind, "steps": steps} for kind in KINDS]


def measure(point: Point) -> Numbers:
    """Measure the linear and the exact strain from the forces on a tetrahedron; compute both in closed form.

    For nu = 0, the stress is E times the strain. The force on a vertex is the stress times a third of the
    area vector of the opposite face. The result is the strain along the stretch, or the off-diagonal entry of
    a shear.
    """
    amounts = [(k + 1) / point["steps"] for k in range(point["steps"])]
    told = {name: [_told(point["kind"], e, name) for e in amounts] for name in ("linear", "exact")}
    return {
        "amount": amounts,
        **told,
        "linear_closed": [_linear(point["kind"], e) for e in amounts],
        "exact_closed": [_exact(point["kind"], e) for e in amounts],
    }


def _told(kind: str, amount: float, strain: StrainName) -> float:
    """Return the strain that the library's forces imply: the entry along the stretch or off the diagonal."""
    x = TET.vertices @ _deformation(kind, amount).T
    forces = internal_forces(TET, Material(YOUNG, 0.0, 1000.0, damping_ratio=0.0), x, strain=strain)
    arms = x[1:] - x[0]
    areas = np.stack([np.cross(arms[(i + 1) % 3], arms[(i + 2) % 3]) for i in range(3)])  # twice the area
    stress = np.linalg.solve(-areas / 6, forces[1:]).T
    return float((stress[0, 0] if kind == "stretch" else stress[0, 1]) / YOUNG)


def _deformation(kind: str, amount: float) -> FloatArray:
    F = np.eye(3)
    F[(0, 0) if kind == "stretch" else (0, 1)] += amount
    return F


def _linear(kind: str, e: float) -> float:
    """Return the entry of the strain 1/2 (F F^T - I), eq. 6.7, along the stretch or off the diagonal."""
    return e + e**2 / 2 if kind == "stretch" else e / 2


def _exact(kind: str, e: float) -> float:
    """Return the entry of the strain sqrt(F F^T) - I along the stretch or off the diagonal.

    For a shear, the root of [[1 + e^2, e], [e, 1]] follows from its trace and its determinant 1.
    """
    return e if kind == "stretch" else float(e / np.sqrt(4 + e**2))


def conclude(results: Results) -> Section:
    """Judge the error of the linearised strain, and check the library's linear and exact strain."""
    numbers = {kind: results.one(kind=kind) for kind in KINDS}
    amount = np.array(numbers["stretch"]["amount"])
    errors = {kind: np.array(n["linear"]) / np.array(n["exact"]) - 1 for kind, n in numbers.items()}
    coded = max(
        float(np.abs(np.array(n[name]) - np.array(n[f"{name}_closed"])).max())
        for n in numbers.values()
        for name in ("linear", "exact")
    )
    small, last = int(np.argmin(np.abs(amount - SMALL))), len(amount) - 1

    def draw(figure: Any) -> None:
        *panels, off = figure.subplots(1, 3)
        for axes, (kind, n) in zip(panels, numbers.items(), strict=True):
            axes.plot(amount, n["linear"], label="linearised, eq. 6.7")
            axes.plot(amount, n["exact"], label="exact, root of F F^T")
            axes.set_xlabel(f"{kind} [1]")
            axes.set_ylabel("strain [1]")
            axes.legend()
            off.loglog(amount, errors[kind], label=kind)
        off.set_xlabel("stretch or shear [1]")
        off.set_ylabel("error over the exact strain [1]")
        off.legend()

    first, end = ({kind: error[row] for kind, error in errors.items()} for row in (small, last))
    return Section(
        (
            "One tetrahedron with nu = 0 is stretched, and sheared, up to 100 %. Its forces give the strain. "
            "In closed form the error is s / 2 for a stretch s, and sqrt(1 + s^2 / 4) - 1 for a shear s.",
        ),
        (
            judged(
                "linear-strain",
                f"error over the exact strain at {amount[small]:.0%}: {first['stretch']:.2%} in stretch, "
                f"{first['shear']:.2%} in shear; at {amount[last]:.0%}: {end['stretch']:.0%}, "
                f"{end['shear']:.0%}; forces tell the strains of the closed form to {coded:.0e}",
                max(abs(float(error)) for error in first.values()) < CLOSE and coded < 1e-9,
                "the linearisation is what is wrong" if coded < 1e-9 else "the code does not follow eq. 6.7",
            ),
        ),
        (
            Table(
                "strains",
                "Strain of one tetrahedron",
                ("deformation", "amount [1]", "linearised [1]", "exact [1]", "error [1]"),
                tuple(
                    (kind, *(float(value) for value in row))
                    for kind, n in numbers.items()
                    for row in zip(amount, n["linear"], n["exact"], errors[kind], strict=True)
                ),
            ),
        ),
        (Plot("strains", "Linearised and exact strain, and the error of the first.", draw, (11.0, 3.5)),),
    )


LINEAR_STRAIN = Experiment(
    "linear-strain",
    "The linearised strain",
    "section 6.1",
    ("linear-strain",),
    points,
    measure,
    conclude,
)
"""The experiment on the linearised strain."""
