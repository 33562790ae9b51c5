"""Strains above 100 % with the laws of chapter 6 (thesis chapter 7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.equilibrium import Plates
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
from lab.experiments.judgement import judged_but_for
from taichi_soft import Material, cylinder, internal_forces

RADIUS, HEIGHT, YOUNG = 0.75, 4.0, 1e6
"""Cylinder of figure 6.3 (b): radius and height [m], Young's modulus [Pa]."""
MESH = (2, 10)
"""Numbers of rings and layers of the cylinder's mesh. The mesh has 720 tetrahedra."""
POISSON = (0.0, 0.1, 0.2, 0.3, 0.4)
STRAINS = ("linear", "exact")
WANTED, FURTHEST = 1.0, 1.2
"""`WANTED` is the strain that the claim states. `FURTHEST` is the largest strain that is tried."""


def points(effort: Effort) -> list[Point]:
    """List the points: each nu with the linearised and the exact strain.

    A quick report has two nu with the linearised strain.
    """
    if effort is Effort.QUICK:
        return [{"poisson": nu, "strain": "linear", "steps": 12} for nu in (0.0, 0.4)]
    return [{"poisson": nu, "strain": strain, "steps": 24} for strain in STRAINS for nu in POISSON]


def measure(point: Point) -> Numbers:
    """Measure the cylinder at each stretch that has an equilibrium.

    Returns: "stretch"; "force", force divided by E A s; "volume", volume divided by the rest volume;
        "smallest", smallest ratio of a tetrahedron's volume to its rest volume.
    """
    mesh = cylinder(RADIUS, HEIGHT, *MESH)
    plates, material = Plates(mesh), Material(YOUNG, point["poisson"], 1000.0, damping_ratio=0.0)

    def forces(x: Any) -> Any:
        return internal_forces(mesh, material, x, strain=point["strain"])

    stretch = [FURTHEST * (k + 1) / point["steps"] for k in range(point["steps"])]
    states = plates.path(forces, (0.0, 0.0, 1.0), stretch)
    volumes = [np.linalg.det(x[mesh.tets][:, 1:] - x[mesh.tets][:, :1]) / 6 for x in states]
    pulls = [float(plates.pull(forces(x))[2]) for x in states]
    return {
        "stretch": stretch[: len(states)],
        "force": [f / (YOUNG * plates.area * s) for f, s in zip(pulls, stretch, strict=False)],
        "volume": [float(v.sum() / mesh.volume) for v in volumes],
        "smallest": [float((v / mesh.volumes).min()) for v in volumes],
    }


def reach(numbers: Numbers) -> float:
    """Return the largest stretch whose equilibrium has no inverted tetrahedron."""
    sound = [s for s, v in zip(numbers["stretch"], numbers["smallest"], strict=True) if v > 0]
    return float(max(sound, default=0.0))


def width_limit(nu: float) -> float:
    """Return the stretch at which the linearised strain gives a bar zero width: 1 - nu (2 s + s^2) = 0."""
    return float(np.sqrt(1 + 1 / nu) - 1) if nu > 0 else np.inf


def conclude(results: Results) -> Section:
    """Judge how far the cylinder can be stretched with each nu."""
    found = {(p["strain"], p["poisson"]): n for p, n in results.where()}
    linear = {nu: n for (strain, nu), n in found.items() if strain == "linear"}
    results.one(poisson=0.0, strain="linear")
    short = [nu for nu, n in linear.items() if reach(n) < WANTED]

    def at_wanted(key: str, numbers: Numbers) -> float:
        return float(np.interp(WANTED, numbers["stretch"], numbers[key]))

    told = "; ".join(
        f"nu = {nu:g}: to {reach(n):.0%}"
        + (
            f" (at {WANTED:.0%} the force is {at_wanted('force', n):.2f} times E A s, and the volume "
            f"{at_wanted('volume', n):.2f} times that at rest)"
            if reach(n) >= WANTED
            else f" (a free bar has no width at {width_limit(nu):.0%})"
        )
        for nu, n in linear.items()
    )
    exact = ", ".join(f"{reach(n):.0%}" for (strain, _), n in found.items() if strain == "exact")
    tail = f". With the exact strain: to {exact}" if exact else ""

    def draw(figure: Any) -> None:
        for axes, key, label in zip(
            figure.subplots(1, 2),
            ("force", "volume"),
            ("force over E A s [1]", "volume over that at rest [1]"),
            strict=True,
        ):
            for (strain, nu), n in found.items():
                line = "-" if strain == "linear" else "--"
                color = f"C{POISSON.index(nu)}"
                axes.plot(n["stretch"], n[key], color + line, label=f"nu = {nu:g}, {strain}")
            axes.set_xlabel("stretch [1]")
            axes.set_ylabel(label)
        axes.legend(fontsize="x-small", ncols=2)

    return Section(
        (
            "The cylinder of figure 6.3 (b) is stretched by plates at its ends, up to "
            f"{FURTHEST:.0%}, until it has no state of rest any more. With the linearised strain a free bar "
            "has the width sqrt(1 - nu (2 s + s^2)) at a stretch s. The larger nu, the sooner it is zero.",
        ),
        (
            judged_but_for(
                "large-strain",
                f"furthest stretch with a state of rest, of {FURTHEST:.0%} tried: {told}{tail}",
                len(short) < len(linear),
                "the strain of eq. 6.7 leaves the cylinder no width",
                [f"nu = {nu:g}" for nu in short],
                "the strain of eq. 6.7 makes the cylinder so slim that it gives way",
            ),
        ),
        (
            Table(
                "stretches",
                "A cylinder stretched as far as it can be",
                ("strain", "nu [1]", "furthest stretch [1]", "force over E A s [1]", "volume [1]"),
                tuple(
                    (strain, nu, n["stretch"][-1], n["force"][-1], n["volume"][-1])
                    for (strain, nu), n in found.items()
                    if n["stretch"]
                ),
            ),
        ),
        (
            Plot(
                "stretches",
                "Force and volume of the stretched cylinder; lines end where no state of rest is found.",
                draw,
                (9.0, 3.8),
            ),
        ),
    )


LARGE_STRAIN = Experiment(
    "large-strain",
    "Strains of over 100 %",
    "chapter 7",
    ("large-strain",),
    points,
    measure,
    conclude,
)
"""The experiment on strains above 100 %."""
