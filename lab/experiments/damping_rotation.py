"""Damping relative to a tetrahedron's mean velocity brakes rotation; edge damping does not (section 6.4).

A stiff body rotates freely. Damping relative to the mean velocity removes angular momentum at the rate b S /
I. I is the moment of inertia about the axis. S is the sum of the squared distances of each tetrahedron's
corners from its centre, measured perpendicular to the axis.
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
from taichi_soft import Material, TetMesh, box, load_mesh
from taichi_soft.core.package_data import ASSETS
from taichi_soft.world.bare import bare_world

YOUNG, POISSON, DENSITY, SPIN = 1e6, 0.1, 1000.0, 2.0  # SPIN [rad/s] is too slow to stretch the body visibly
DT, SUBSTEPS = 1 / 60, 12
MODELS = ("edge", "tet_mean")
KEPT, RATE_ERROR = 1e-3, 0.05
"""`KEPT` is the largest relative loss of angular momentum with edge damping. `RATE_ERROR` is the largest
relative error of the decay rate with damping relative to the mean velocity."""


def points(effort: Effort) -> list[Point]:
    """List the points: a cube, and for a full report also other damping constants and the thesis's sphere."""
    cases = [("cube", 10.0, 2.0)]
    if effort is Effort.FULL:
        cases += [("cube", 1.0, 10.0), ("cube", 100.0, 2.0), ("sphere", 100.0, 2.0)]
    return [
        {"mesh": mesh, "damping": b, "seconds": seconds, "model": model}
        for mesh, b, seconds in cases
        for model in MODELS
    ]


def body_mesh(name: str) -> TetMesh:
    """Return the mesh of a cube of 1 m, or of the thesis's sphere."""
    return box((1.0, 1.0, 1.0), (3, 3, 3)) if name == "cube" else load_mesh(ASSETS / "sphere.npz")


def measure(point: Point) -> Numbers:
    """Measure the angular momentum over time, relative to its initial value.

    The result also has the "expected" decay rate [1/s].
    """
    mesh = body_mesh(point["mesh"])
    world = bare_world(gravity=(0, 0, 0), retries=0)
    material = Material(YOUNG, POISSON, DENSITY, point["damping"], damping_ratio=0.0)
    body = world.add_body(mesh, material, damping_model=point["model"], position=(0, 0, 5.0), law="virial")
    world.build()
    body.set_velocity((0, 0, 0), (0, 0, SPIN))
    first = body.angular_momentum()[2]
    time, left = [], []
    for step in range(round(point["seconds"] / DT)):
        world.step(DT, SUBSTEPS)
        if step % 6 == 5:
            time.append(world.time)
            left.append(float(body.angular_momentum()[2] / first))
    corners = mesh.vertices[mesh.tets][:, :, :2]
    spread = float(((corners - corners.mean(axis=1, keepdims=True)) ** 2).sum())
    center = body.masses @ mesh.vertices / body.masses.sum()
    inertia = float(body.masses @ ((mesh.vertices - center)[:, :2] ** 2).sum(axis=1))
    return {"time": time, "left": left, "expected": point["damping"] * spread / inertia}


def rate(numbers: Numbers) -> float:
    """Return the decay rate of the angular momentum [1/s].

    The rate is fitted to the values above a tenth of the initial angular momentum.
    """
    time, left = np.array([0.0, *numbers["time"]]), np.array([1.0, *numbers["left"]])
    seen = left > 0.1
    return 0.0 if seen.sum() < 2 else -float(np.polyfit(time[seen], np.log(left[seen]), 1)[0])


def conclude(results: Results) -> Section:
    """Judge how much of the rotation remains with each damping model."""
    edge, mean = (results.one(mesh="cube", damping=10.0, model=model) for model in MODELS)
    lost = max(abs(1.0 - left) for left in edge["left"])
    keeps, brakes = lost < KEPT, mean["left"][-1] < 0.5
    ratio = rate(mean) / mean["expected"]
    measured = (
        f"after {edge['time'][-1]:.1f} s edge damping has taken {lost:.1g} of the angular momentum, damping "
        f"against the mean {1 - mean['left'][-1]:.2f} of it, at {ratio:.3f} of the rate b S / I of a rigid "
        "body"
    )
    exact = abs(ratio - 1.0) < RATE_ERROR
    agrees = keeps and brakes and exact
    why = "" if agrees else "the model: "
    if not keeps:
        why += "edge damping brakes the spin"
    elif not brakes:
        why += "damping against the mean does not brake it"
    elif not exact:
        why += "the rate is not that of a rigid body"
    rows = tuple(
        (p["mesh"], p["damping"], p["model"], *(float(f"{v:.3g}") for v in (n["left"][-1], rate(n))),
         float(f"{n['expected']:.3g}") if p["model"] == "tet_mean" else 0.0)
        for p, n in results.where()
    )  # fmt: skip
    columns = ("body", "damping [N s/m]", "model", "left at the end [1]", "rate [1/s]", "expected [1/s]")
    return Section(
        (f"Bodies of E = 1 MPa spin freely at {SPIN:g} rad/s about the vertical axis.",),
        (Finding("damping-rotation", measured, Verdict.AGREES if agrees else Verdict.DIFFERS, why),),
        (Table("rates", "How fast the spin fades", columns, rows),),
        (
            Plot(
                "spin",
                "Angular momentum of the cube over that at the start; dashes: exp(-b S t / I).",
                lambda figure: _draw(figure, edge, mean),
            ),
        ),
    )


def _draw(figure: Any, edge: Numbers, mean: Numbers) -> None:
    axes = figure.add_subplot()
    axes.plot(edge["time"], edge["left"], label="edge")
    axes.plot(mean["time"], mean["left"], label="tet_mean")
    time = np.linspace(0.0, mean["time"][-1])
    axes.plot(time, np.exp(-mean["expected"] * time), "--", color="black", label="rigid body, tet_mean")
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("angular momentum left [1]")
    axes.legend()


DAMPING_ROTATION = Experiment(
    "damping-rotation",
    "Damping that brakes rotation",
    "section 6.4",
    ("damping-rotation",),
    points,
    measure,
    conclude,
)
