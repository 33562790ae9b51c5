"""Energy budget of a falling, bending bar (not in the thesis).

A bar clamped at one end is released from the horizontal, falls, and swings about its bent shape. The work of
gravity must equal the sum of the kinetic energy, the strain energy and the energy lost in the edges' dampers.
This experiment computes all energies in float64 from positions and velocities only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from taichi_soft import Material, TetMesh, box
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

YOUNG, POISSON, DENSITY = 1e6, 0.3, 1000.0
DAMPING = 150.0  # [N s/m]
WITH_ENERGY = ("st_venant_kirchhoff", "neo_hookean")
GRAVITY = 9.81
PART = 0.5  # length of a substep [stable substep]; leapfrog's energy error grows with its square
FRAMES = 120
UNDAMPED, DAMPED = 1e-3, 1e-3
"""Largest error of the budget without damping, and largest error with damping [work of gravity]."""


def points(effort: Effort) -> list[Point]:
    """List the points: two laws with an energy, undamped and damped, and the thesis's law, undamped.

    The thesis's law has no energy.
    """
    seconds = 0.6 if effort is Effort.QUICK else 6.0
    rows = [(law, damping) for law in WITH_ENERGY for damping in (0.0, DAMPING)]
    return [{"law": law, "damping": b, "seconds": seconds} for law, b in [*rows, ("virial", 0.0)]]


def measure(point: Point) -> Numbers:
    """Measure over time [J]: kinetic, elastic and potential energy, energy lost to damping, and their sum."""
    mesh = box((1.0, 0.2, 0.2), (10, 2, 2))
    material = Material(YOUNG, POISSON, DENSITY, point["damping"], damping_ratio=0.0)
    held = np.flatnonzero(mesh.vertices[:, 0] < -0.5 + 1e-9)
    world = bare_world(gravity=(0, 0, -GRAVITY), floor=None, retries=0)
    body = world.add_body(mesh, material, law=point["law"], pinned=held)
    world.build()
    dt = 2 * PART * body.stable_step.limit
    steps = round(point["seconds"] / dt)
    rest_inverse = np.linalg.inv(_edges(mesh, mesh.vertices))
    energies, damped, power = np.zeros((steps + 1, 4)), 0.0, 0.0
    for step in range(steps + 1):
        x, v = body.positions().astype(np.float64), body.velocities().astype(np.float64)
        before, power = power, _damping_power(mesh, x, v, point["damping"])
        damped += dt * (before + power) / 2 if step else 0.0
        deformed = np.swapaxes(rest_inverse @ _edges(mesh, x), 1, 2)
        elastic = mesh.volumes @ _energy_density(point["law"], deformed)
        place = GRAVITY * body.masses @ (x - mesh.vertices)[:, 2]
        energies[step] = 0.5 * body.masses @ (v**2).sum(axis=1), elastic, place, damped
        if step < steps:
            world.step(dt, 2)
    missing = energies.sum(axis=1)
    kept = np.linspace(0, steps, FRAMES).round().astype(int)
    names = ("kinetic", "elastic", "place", "damped")
    return {
        "given": float(-energies[:, 2].min()),
        "error": float(np.abs(missing).max()),
        "times": (dt * kept).round(5).tolist(),
        "sum": missing[kept].round(5).tolist(),
        **{name: energies[kept, column].round(4).tolist() for column, name in enumerate(names)},
    }


def _edges(mesh: TetMesh, positions: Floats) -> Floats:
    """Return the edges from the first vertex of each tetrahedron to the others, as rows, (m, 3, 3) [m]."""
    corners = positions[mesh.tets]
    return np.asarray(corners[:, 1:] - corners[:, :1])


def _energy_density(law: LawName, F: Floats) -> Floats:
    """Return the energy density for deformation gradients (m, 3, 3), (m,) [J/m^3].

    For a law without an energy, return the energy of Hooke's law. Strains computed from F F^T and from F^T F
    give the same energy.
    """
    mu, lam = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    if law == "neo_hookean":  # Smith, de Goes and Kim 2018, eq. 14 with the constants of their section 3.4
        m, bulk = 4 / 3 * mu, lam + 5 / 6 * mu
        alpha = 1 + m / bulk - m / (4 * bulk)
        squares = (F**2).sum(axis=(1, 2))
        at_rest = bulk / 2 * (1 - alpha) ** 2 - m / 2 * np.log(4)
        grown = bulk / 2 * (np.linalg.det(F) - alpha) ** 2
        return np.asarray(m / 2 * (squares - 3) + grown - m / 2 * np.log(squares + 1) - at_rest)
    strain = (np.swapaxes(F, 1, 2) @ F - np.eye(3)) / 2
    return np.asarray(mu * (strain**2).sum(axis=(1, 2)) + lam / 2 * np.trace(strain, axis1=1, axis2=2) ** 2)


def _damping_power(mesh: TetMesh, x: Floats, v: Floats, damping: float) -> float:
    """Return the power lost in the dampers of all edges [W].

    The power is the sum of b (n . dv)^2, with the damping b, the unit vector n along an edge, and the
    velocity difference dv of its ends.
    """
    p, q = mesh.edges.T
    along = x[q] - x[p]
    closing = ((v[q] - v[p]) * along).sum(axis=1) / np.linalg.norm(along, axis=1)
    return float(damping * closing @ closing)


def conclude(results: Results) -> Section:
    """Judge the budget of the laws with an energy."""
    rows = results.where()
    lost = {(p["law"], p["damping"]): n["error"] / n["given"] for p, n in rows}
    undamped, damped = (max(lost[law, b] for law in WITH_ENERGY) for b in (0.0, DAMPING))
    agrees = undamped < UNDAMPED and damped < DAMPED
    shown = results.one(law="neo_hookean", damping=DAMPING)
    taken = shown["damped"][-1] / shown["given"]
    finding = judged_but_for(
        "energy-budget",
        f"of the {shown['given']:.0f} J that gravity gives, undamped no more than {undamped:.1g} "
        f"is ever missing with a law that has an energy; with dampers, which take {taken:.0%}, {damped:.1g}. "
        f"The virial law has none: with Hooke's energy in its place {lost['virial', 0.0]:.1%} are missing",
        agrees,
        "the integrator, or the forces: the energies are computed apart from both, and the limits are "
        f"{UNDAMPED:g} undamped and {DAMPED:g} damped",
        ["virial"] if lost["virial", 0.0] >= UNDAMPED else [],
        "its stress is not the derivative of an energy",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        bottom = np.zeros(len(shown["times"]))
        for name, label in (("kinetic", "motion"), ("elastic", "strain"), ("damped", "taken by damping")):
            top = bottom + shown[name]
            axes.fill_between(shown["times"], bottom, top, alpha=0.5, label=label)
            bottom = top
        axes.plot(shown["times"], -np.array(shown["place"]), "k--", label="given by gravity")
        axes.set_xlabel("time [s]")
        axes.set_ylabel("energy [J]")
        axes.legend()

    def draw_errors(figure: Any) -> None:
        axes = figure.add_subplot()
        for point, numbers in rows:
            name = f"{point['law']}, {'damped' if point['damping'] else 'undamped'}"
            parts = np.abs(numbers["sum"]) / numbers["given"]
            axes.semilogy(numbers["times"], np.maximum(parts, 1e-8), label=name)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("missing, over what gravity gave [1]")
        axes.set_ylim(1e-10, 0.1)
        axes.legend(fontsize=8, loc="lower center", ncols=2)

    return Section(
        (
            f"A bar of 1 x 0.2 x 0.2 m (E = {YOUNG:g} Pa, nu = {POISSON}, {DENSITY:g} kg/m^3), attached at "
            "one end, is released. Strain energies are those of the laws' papers. The damped energy is the "
            f"sum of b (n . dv)^2 over all edges (eq. 3.9, b = {DAMPING:g} N s/m), integrated over time.",
        ),
        (finding,),
        (
            Table(
                "budget",
                "Energy of a falling bar",
                (
                    *("law", "damping [N s/m]", "given by gravity [J]", "damped in the end [J]"),
                    *("missing at most [J]", "over what was given [1]"),
                ),
                tuple(
                    (
                        *(p["law"], p["damping"], n["given"], n["damped"][-1]),
                        *(n["error"], n["error"] / n["given"]),
                    )
                    for p, n in rows
                ),
            ),
        ),
        (
            Plot("energies", "Where the energy is, one above the other: neo_hookean with damping.", draw),
            Plot(
                "missing", "What is missing or too much. The virial law has no energy to keep.", draw_errors
            ),
        ),
    )


ENERGY_BUDGET = Experiment(
    "energy-budget",
    "Where energy goes",
    "beyond the thesis: mechanics",
    ("energy-budget",),
    points,
    measure,
    conclude,
)
