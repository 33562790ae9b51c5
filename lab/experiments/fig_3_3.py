"""Regions of stability (thesis figure 3.3), measured from steps of damped oscillators.

An oscillator m u'' = -k u - b u' has the eigenvalue lambda and its conjugate. Each oscillator realises one
point h lambda of a grid. Because b >= 0, the grid covers the left half of the plane and the imaginary axis.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from lab.experiments.oscillators import step_factors
from taichi_soft.core.types import IntegratorName

INTEGRATORS: tuple[IntegratorName, ...] = ("explicit_euler", "implicit_euler")
LEFT, TOP = -3.0, 2.4
"""Left and upper bound of the grid in the plane of h lambda. The lower half of the plane mirrors the upper
half."""

CLOSE = 1e-3
"""A point is not judged if its exact factor differs from 1 by less than this number. For such a point,
float32 rounding decides."""


def points(effort: Effort) -> list[Point]:
    """List the points: each method on a grid of 31 x 16 or 76 x 40 values."""
    cells = 10 if effort is Effort.QUICK else 25
    return [{"integrator": name, "cells": cells} for name in INTEGRATORS]


def grid(cells: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the coordinates of the grid: real parts (nx,) and imaginary parts (ny,) of h lambda.

    The real parts are 0 and the centres of the cells to the left of the imaginary axis.
    """
    step = 1.0 / cells
    x = np.append(-(np.arange(round(-LEFT * cells)) + 0.5)[::-1] * step, 0.0)
    y = (np.arange(round(TOP * 2 / 3 * cells)) + 0.5) * step * 1.5
    return np.asarray(x, np.float64), np.asarray(y, np.float64)


def measure(point: Point) -> Numbers:
    """Measure the largest factor by which a step multiplies the motion, at each point of the grid.

    The rows of the result begin at the real axis.
    """
    x, y = grid(point["cells"])
    z = (x + 1j * y[:, None]).ravel()
    factors = step_factors(point["integrator"], np.abs(z) ** 2, -2 * z.real)
    return {"factor": factors.reshape(len(y), len(x)).round(6).tolist()}


def closed_form(integrator: IntegratorName, z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the exact factor of a step at each h lambda (eq. 3.5 and 3.6)."""
    return np.asarray(np.abs(1 + z) if integrator == "explicit_euler" else np.abs(1 / (1 - z)))


def conclude(results: Results) -> Section:
    """Judge each method by the points whose measured and exact factors lie on different sides of 1."""
    rows, wrong_of, worst_of, maps = [], {}, {}, {}
    for name in INTEGRATORS:
        measured = np.array(results.one(integrator=name)["factor"])
        x, y = grid(results.where(integrator=name)[0][0]["cells"])
        expected = closed_form(name, x + 1j * y[:, None])
        clear = np.abs(expected - 1) > CLOSE
        wrong_of[name] = int(((measured < 1) != (expected < 1))[clear].sum())
        worst_of[name] = float(np.abs(measured - expected).max())
        maps[name] = (x, y, measured)
        rows.append(
            (name, int(clear.sum()), int((measured < 1).sum()), wrong_of[name], f"{worst_of[name]:.1g}")
        )
    wrong, worst, total = sum(wrong_of.values()), max(worst_of.values()), sum(row[1] for row in rows)

    def draw(figure: Any) -> None:
        for panel, name in enumerate(INTEGRATORS):
            axes = figure.add_subplot(1, 2, panel + 1)
            x, y, measured = maps[name]
            axes.pcolormesh(
                x,
                np.r_[-y[::-1], y],
                np.r_[measured[::-1], measured] < 1,
                cmap="Blues",
                vmin=0,
                vmax=2,
                shading="nearest",
            )
            a, b = np.meshgrid(np.linspace(LEFT, 2.2, 300), np.linspace(-TOP, TOP, 300))
            outside = closed_form(name, a + 1j * b)
            axes.contour(a, b, outside, [1.0], colors="k", linewidths=1)
            axes.axvline(0, color="grey", linewidth=0.5)
            axes.axhline(0, color="grey", linewidth=0.5)
            axes.set_aspect("equal")
            axes.set_title(name)
            axes.set_xlabel("Re h lambda [1]")
            if panel == 0:
                axes.set_ylabel("Im h lambda [1]")
        figure.tight_layout()

    return Section(
        (
            "Each point is an oscillator whose stiffness and damping give it that eigenvalue. Its motion "
            "over three steps gives the factor by which a step multiplies it. To the right of the "
            "imaginary axis an oscillator would be driven instead of damped. No material of this package "
            "does that: only the closed form is drawn there.",
        ),
        (
            Finding(
                "stability-regions",
                f"of {total} points {wrong} lie on the wrong side of the circles; the factor of a step "
                f"deviates from abs(1 + h lambda) and abs(1 / (1 - h lambda)) by {worst:.1g} at most",
                Verdict.AGREES if wrong == 0 else Verdict.DIFFERS,
                "" if wrong == 0 else "the closed forms follow from eq. 3.5 and 3.6: the integrators differ",
            ),
        ),
        (
            Table(
                "regions",
                "Points on a grid over the left half of the plane",
                ("integrator", "points", "stable", "on the wrong side", "largest deviation of a factor [1]"),
                tuple(rows),
            ),
        ),
        (
            Plot(
                "regions",
                "Where a step makes the motion smaller (blue, measured), and the closed form (black).",
                draw,
                (7.5, 3.6),
            ),
        ),
    )


FIG_3_3 = Experiment(
    "fig-3.3", "Regions of stability", "figure 3.3", ("stability-regions",), points, measure, conclude
)
