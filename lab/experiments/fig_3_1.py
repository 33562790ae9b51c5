"""Exponential decay with both Euler methods (thesis figure 3.1): y' = lambda y with lambda < 0 and y(0) = 1.

y is the velocity of a particle on which only a damping force acts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

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
from lab.experiments.oscillators import SLACK, run_oscillators

EULER = ("explicit_euler", "implicit_euler")
INTEGRATORS = (*EULER, "leapfrog")
RATES = (-0.1, -0.25, -0.5, -0.75, -1.5)
"""Values of h lambda. For the last value, explicit Euler changes the sign of y in every step."""

DRAWN = -0.5
START = 1e-2
"""Initial velocity y(0) [m/s]. Measured velocities are divided by this value."""


def points(effort: Effort) -> list[Point]:
    """List the points: each method, over 6 or 20 steps."""
    steps = 6 if effort is Effort.QUICK else 20
    return [{"integrator": name, "steps": steps} for name in INTEGRATORS]


def measure(point: Point) -> Numbers:
    """Measure y after each step, for each of `RATES`."""
    none = np.zeros(len(RATES))
    _, v = run_oscillators(
        point["integrator"], none + SLACK, -np.array(RATES), (none, none + START), point["steps"]
    )
    return {name: (row / START).tolist() for name, row in zip(map(str, RATES), v.T, strict=True)}


def conclude(results: Results) -> Section:
    """Judge on which side of the exact curve each method lies, for steps that keep the sign of y."""
    found = {name: results.one(integrator=name) for name in INTEGRATORS}
    steady = [rate for rate in RATES if rate > -1]

    def excess(name: str, rate: float) -> np.ndarray[Any, np.dtype[np.float64]]:
        y = np.array(found[name][str(rate)])
        return np.asarray((y - np.exp(rate * np.arange(len(y))))[1:])

    def method_error(name: str) -> float:
        factors = {
            rate: 1 + rate if name == "explicit_euler" else 1 / (1 - rate) for rate in RATES
        }  # eq. 3.5, 3.6
        return max(
            float(
                np.abs(
                    np.array(found[name][str(rate)]) - factor ** np.arange(len(found[name][str(rate)]))
                ).max()
            )
            for rate, factor in factors.items()
        )

    findings = []
    for claim, name, side in (("decay-explicit", EULER[0], -1), ("decay-implicit", EULER[1], 1)):
        agrees = all((side * excess(name, rate) > 0).all() for rate in steady)
        first = found[name][str(DRAWN)][1]
        word = "below" if side < 0 else "above"
        findings.append(
            Finding(
                claim,
                f"at h lambda = {DRAWN} one step leaves {first:.3f}, the exact curve {np.exp(DRAWN):.3f}; "
                f"{'always' if agrees else 'not always'} {word} it for h lambda from {steady[0]} to "
                f"{steady[-1]}",
                Verdict.AGREES if agrees else Verdict.DIFFERS,
                ""
                if agrees
                else f"the closed form of the method is met to {method_error(name):.1g}: if that is little, "
                "the statement is at fault, otherwise the integrator",
            )
        )
    crossing = found["explicit_euler"][str(RATES[-1])][1]

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        count = len(found[EULER[0]][str(DRAWN)])
        time = np.linspace(0, count - 1, 200)
        axes.plot(-DRAWN * time, np.exp(DRAWN * time), ":k", label="exact")
        for name, mark in zip(INTEGRATORS, "os^", strict=True):
            axes.plot(
                -DRAWN * np.arange(count), found[name][str(DRAWN)], mark + "-", label=name, markersize=4
            )
        axes.set_xlabel("time, over 1 / abs(lambda) [1]")
        axes.set_ylabel("y [1]")
        axes.legend()

    rows = tuple(
        (rate, round(float(np.exp(rate)), 5), *(round(found[name][str(rate)][1], 5) for name in INTEGRATORS))
        for rate in RATES
    )
    return Section(
        (
            "A particle with a drag proportional to its velocity obeys y' = lambda y. The text says "
            "that explicit Euler overshoots the curve and implicit Euler undershoots it. For the heights of "
            "the curves the opposite is true: explicit Euler falls below the exact one, implicit Euler "
            "stays above. For the extent of the decay the text is right.",
            f"Beyond h lambda = -1 explicit Euler overshoots zero: at {RATES[-1]} one step leaves "
            f"{crossing:.2f}.",
        ),
        tuple(findings),
        (
            Table(
                "decay",
                "What is left after one step",
                ("h lambda [1]", "exact [1]", *(f"{n} [1]" for n in INTEGRATORS)),
                rows,
            ),
        ),
        (
            Plot(
                "decay",
                f"Decay at h lambda = {DRAWN}, as in figure 3.1. Leapfrog starts with half a step.",
                draw,
            ),
        ),
    )


FIG_3_1 = Experiment(
    "fig-3.1",
    "Decay by explicit and implicit Euler",
    "figure 3.1",
    ("decay-explicit", "decay-implicit"),
    points,
    measure,
    conclude,
)
