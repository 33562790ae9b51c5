"""A standing wave with both Euler methods (thesis figure 3.2): the first mode of a row of springs.

The row discretises the wave equation. Its modes and the change of amplitude per step are known exactly.
Explicit Euler multiplies the amplitude by abs(1 + i h w) = sqrt(1 + h^2 w^2). Implicit Euler divides the
amplitude by this factor.
"""

from __future__ import annotations

import warnings
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
from taichi_soft import ParticleMesh, SpringMaterial, UnstableStepWarning
from taichi_soft.core.types import IntegratorName
from taichi_soft.world.bare import bare_world

INTEGRATORS: tuple[IntegratorName, ...] = ("explicit_euler", "implicit_euler", "leapfrog")
MOVING = 5
"""Number of particles between the fixed ends. With more particles, explicit Euler would amplify round-off in
higher modes before it visibly amplifies the first mode."""

PERIODS = 2
AMPLITUDE = 0.05
"""Amplitude of the middle particle [m]; the springs are 1 m long."""

ANGLES = (0.05, 0.1)
"""Values of h w: step length times angular frequency."""

DRAWN = 0.1
STEADY = 0.02
"""The amplitude counts as constant if its relative change during a run is at most this number."""


def points(_: Effort) -> list[Point]:
    """List the points: each method and step length."""
    return [{"integrator": name, "angle": angle} for name in INTEGRATORS for angle in ANGLES]


def measure(point: Point) -> Numbers:
    """Measure displacement and amplitude of the mode after each step, relative to their initial values."""
    count = MOVING + 2
    rest = np.zeros((count, 3))
    rest[:, 0] = np.arange(count) - (count - 1) / 2
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    angle = point["angle"]
    # w = 2 sqrt(k / m) sin(pi / (2 (n + 1))), with 1 kg and h = 1 s
    stiffness = (angle / (2 * np.sin(np.pi / (2 * (MOVING + 1))))) ** 2
    shape = np.sin(np.pi * np.arange(count) / (MOVING + 1))
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnstableStepWarning)
        world = bare_world(
            gravity=(0, 0, 0), floor=None, integrator=point["integrator"], tolerance=1e-6, retries=0
        )
        body = world.add_body(
            ParticleMesh(rest, edges, np.ones(count)),
            SpringMaterial(stiffness),
            law="springs",
            pinned=[0, count - 1],
        )
        world.build()
        body.set_motion(rest + AMPLITUDE * np.outer(shape, (1, 0, 0)), np.zeros_like(rest))
        for step in range(round(PERIODS * 2 * np.pi / angle) + 1):
            if step:
                world.step(1.0, 1)
            mode = shape / (shape @ shape) / AMPLITUDE
            found.append((mode @ (body.positions() - rest)[:, 0], mode @ body.velocities()[:, 0] / angle))
    u, v = np.array(found).T
    return {"displacement": u.round(7).tolist(), "amplitude": np.hypot(u, v).round(7).tolist()}


def per_step(integrator: IntegratorName, angle: float) -> float:
    """Return the exact factor by which a step multiplies the amplitude; `angle` is h w."""
    growth = float(np.hypot(1.0, angle))
    return {"explicit_euler": growth, "implicit_euler": 1 / growth}.get(integrator, 1.0)


def conclude(results: Results) -> Section:
    """Judge whether the amplitudes grow or decay, and whether the rate is correct."""
    findings, rows = [], []
    for claim, name in (
        ("wave-explicit", INTEGRATORS[0]),
        ("wave-implicit", INTEGRATORS[1]),
        ("", INTEGRATORS[2]),
    ):
        worst, ends = 0.0, []
        for angle in ANGLES:
            amplitude = np.array(results.one(integrator=name, angle=angle)["amplitude"])
            steps = len(amplitude) - 1
            expected = per_step(name, angle) ** np.arange(steps + 1)
            worst = max(worst, float(np.abs(amplitude / expected - 1).max()))
            ends.append(float(amplitude[-1]))
            rows.append((name, angle, steps, round(ends[-1], 4), round(float(expected[-1]), 4)))
        if claim:
            grows = claim == "wave-explicit"
            agrees = all(end > 1 + STEADY if grows else end < 1 - STEADY for end in ends)
            findings.append(
                Finding(
                    claim,
                    f"after {rows[-1][2]} steps of h w = {ANGLES[-1]} the amplitude is {ends[-1]:.2f} times "
                    f"that at the start; closed form {rows[-1][4]:.2f}, largest deviation from it on the way "
                    f"{100 * worst:.2g} %",
                    Verdict.AGREES if agrees else Verdict.DIFFERS,
                    ""
                    if agrees
                    else "the closed form of the method does change it: the integrator is at fault",
                )
            )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for name in INTEGRATORS:
            u = results.one(integrator=name, angle=DRAWN)["displacement"]
            time = np.arange(len(u)) * DRAWN / (2 * np.pi)
            axes.plot(time, u, label=name)
        axes.plot(time, np.cos(2 * np.pi * time), ":k", label="exact")
        axes.set_xlabel("time, over the period [1]")
        axes.set_ylabel("displacement, over the first [1]")
        axes.legend(loc="lower left")

    return Section(
        (
            f"A row of {MOVING} particles between two fixed ones starts in the shape of its first mode. "
            "Its energy should stay constant. Explicit Euler adds energy at every step and implicit Euler "
            "removes it, both by the factor of theory. Leapfrog does neither.",
        ),
        tuple(findings),
        (
            Table(
                "amplitudes",
                "Amplitude at the end, over that at the start",
                ("integrator", "h w [1]", "steps", "measured [1]", "closed form [1]"),
                tuple(rows),
            ),
        ),
        (Plot("wave", f"The standing wave at h w = {DRAWN}, as in figure 3.2.", draw),),
    )


FIG_3_2 = Experiment(
    "fig-3.2",
    "A wave by explicit and implicit Euler",
    "figure 3.2",
    ("wave-explicit", "wave-implicit"),
    points,
    measure,
    conclude,
)
