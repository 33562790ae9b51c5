"""Orders of the integrators (thesis section 3.5), and accuracy of lazy leapfrog.

An oscillator is released from rest, and its motion is compared with the cosine.
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
from lab.experiments.oscillators import run_oscillators

ORDERS = {"explicit_euler": 1, "lazy_leapfrog": 1, "leapfrog": 2, "implicit_euler": 1}
"""Theoretical orders of the error in position and velocity at the same time. The thesis gives all orders
except that of lazy leapfrog."""

ORDER_TOLERANCE = 0.15
START = 0.02
"""Initial displacement [m]. Errors are divided by this value."""

STEPS = (32, 64, 128, 256)
"""Numbers of steps per period. With more steps, rounding of float32 dominates."""

LONG_ANGLE, LONG_PERIODS = 0.1, 10
"""Value of h w in the long run, and number of its periods."""

NEARLY = 5.0
"""An integrator is nearly as good as leapfrog if its error in the long run is at most this multiple of
leapfrog's error."""


def points(effort: Effort) -> list[Point]:
    """List the points: each integrator over one period (four step lengths) and over ten periods (one)."""
    del effort  # the full run is short enough for a quick report
    return [{"integrator": name, "run": run} for name in ORDERS for run in ("period", "long")]


def measure(point: Point) -> Numbers:
    """Measure the errors over one period for each of `STEPS`, or the displacements of the long run.

    The long run starts from rest, and a second time from a shifted initial velocity ("kicked").
    """
    name = point["integrator"]
    if point["run"] == "period":
        angles = 2 * np.pi / np.array(STEPS)
        start = (np.full(len(STEPS), START), np.zeros(len(STEPS)))
        u, v = run_oscillators(name, angles**2, 0 * angles, start, max(STEPS))
        time = np.arange(max(STEPS) + 1)[:, None] * angles
        gap = np.hypot(u / START - np.cos(time), v / START / angles + np.sin(time))
        return {"errors": [float(gap[: n + 1, i].max()) for i, n in enumerate(STEPS)]}
    k = LONG_ANGLE**2
    steps = round(LONG_PERIODS * 2 * np.pi / LONG_ANGLE)
    # The second start adds half a kick to leapfrog's first half kick. The sum is lazy leapfrog's full kick.
    kicked = ((START, START), (0.0, -k * START / 2))
    u, _ = run_oscillators(name, (k, k), (0.0, 0.0), kicked, steps)
    return {
        "displacement": (u[:, 0] / START).round(7).tolist(),
        "kicked": (u[:, 1] / START).round(7).tolist(),
    }


def conclude(results: Results) -> Section:
    """Judge the slopes of the errors, and the errors of the long run relative to those of leapfrog."""
    errors = {name: results.one(integrator=name, run="period")["errors"] for name in ORDERS}
    slopes = {name: float(np.log2(e[-3] / e[-1])) / 2 for name, e in errors.items()}
    long = {name: results.one(integrator=name, run="long") for name in ORDERS}
    lasting = {}
    for name, numbers in long.items():
        u = np.array(numbers["displacement"])
        lasting[name] = float(np.abs(u - np.cos(LONG_ANGLE * np.arange(len(u)))).max())
    same = float(np.abs(np.array(long["leapfrog"]["kicked"]) - long["lazy_leapfrog"]["displacement"]).max())
    named = [name for name in ORDERS if name != "lazy_leapfrog"]
    has_orders = all(abs(slopes[name] - ORDERS[name]) < ORDER_TOLERANCE for name in named)
    ratio, euler = (lasting[name] / lasting["leapfrog"] for name in ("lazy_leapfrog", "explicit_euler"))
    is_good = ratio < NEARLY < euler
    fine = errors["lazy_leapfrog"][-1] / errors["leapfrog"][-1]
    findings = (
        Finding(
            "lazy-leapfrog",
            f"over {LONG_PERIODS} periods at h w = {LONG_ANGLE} its position errs {ratio:.2g} times as "
            "much as "
            f"leapfrog's, explicit Euler's {euler:.2g} times; in one period of {STEPS[-1]} steps "
            "position and "
            f"velocity err {fine:.2g} times as much, being of order {slopes['lazy_leapfrog']:.2f}",
            Verdict.AGREES if is_good else Verdict.DIFFERS,
            ""
            if is_good
            else "leapfrog with half a kick more at the start moves the same particle within "
            f"{same:.1g} of the amplitude: where that is little, the first velocity is the cause",
        ),
        Finding(
            "integrator-orders",
            "; ".join(f"{name} {slopes[name]:.2f}" for name in ORDERS)
            + f", from {STEPS[-3]} to {STEPS[-1]} steps a period",
            Verdict.AGREES if has_orders else Verdict.DIFFERS,
            ""
            if has_orders
            else "the oscillator is linear and the cosine exact: the integrators are the cause",
        ),
    )

    def draw_errors(figure: Any) -> None:
        axes = figure.add_subplot()
        h = 2 * np.pi / np.array(STEPS)
        for name, mark in zip(ORDERS, "osv^", strict=True):
            axes.loglog(h, errors[name], mark + "-", label=name)
        for order, at in ((1, 0.3), (2, 0.03)):
            axes.loglog(h, at * errors["explicit_euler"][0] * (h / h[0]) ** order, ":k", linewidth=1)
        axes.set_xlabel("h w [1]")
        axes.set_ylabel("largest error in a period, over the amplitude [1]")
        axes.legend()

    def draw_long(figure: Any) -> None:
        axes = figure.add_subplot()
        for name in ("leapfrog", "lazy_leapfrog", "implicit_euler", "explicit_euler"):
            u = np.array(long[name]["displacement"])
            time = LONG_ANGLE * np.arange(len(u))
            axes.plot(time / (2 * np.pi), u, label=name)
        axes.set_ylim(-4, 6)
        axes.set_xlabel("time, over the period [1]")
        axes.set_ylabel("displacement, over the first [1]")
        axes.legend(loc="upper left", ncols=2)

    rows = tuple(
        (name, *(f"{e:.2g}" for e in errors[name]), round(slopes[name], 2), f"{lasting[name]:.2g}")
        for name in ORDERS
    )
    return Section(
        (
            "Velocity and position of lazy leapfrog belong to times half a step apart. This counts as an "
            "error of first order, but it does not grow. From a velocity changed by half a kick, "
            f"leapfrog moves the same particle to within {same:.1g} of the amplitude: except for its start, "
            "lazy leapfrog is leapfrog.",
        ),
        findings,
        (
            Table(
                "orders",
                "Largest error in a period, over the amplitude",
                (
                    "integrator",
                    *(f"{n} steps [1]" for n in STEPS),
                    "order [1]",
                    f"error of position in {LONG_PERIODS} periods [1]",
                ),
                rows,
            ),
        ),
        (
            Plot("orders", "Errors shrink with h (upper dotted line) or with h^2 (lower).", draw_errors),
            Plot(
                "long",
                f"{LONG_PERIODS} periods at h w = {LONG_ANGLE}: the two leapfrogs lie on each other.",
                draw_long,
            ),
        ),
    )


INTEGRATOR_ORDERS = Experiment(
    "integrator-orders",
    "Orders of the integrators",
    "section 3.5",
    ("lazy-leapfrog", "integrator-orders"),
    points,
    measure,
    conclude,
)
