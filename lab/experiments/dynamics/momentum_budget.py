"""Momentum and angular momentum of a free, tumbling, vibrating body under every law (not in the thesis)."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.dynamics.compared_laws import TETRAHEDRAL, laws_of
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
from taichi_soft import FrozenBodyWarning, Material, box
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

SIZE, CELLS = (1.0, 0.5, 0.5), (4, 2, 2)
YOUNG, POISSON, DENSITY = 1e5, 0.3, 1000.0
DAMPING = 20.0  # [N s/m]
VELOCITY, SPIN = np.array([1.0, 0.5, -0.3]), np.array([0.5, 3.0, 1.0])  # [m/s], [rad/s]
STRETCH, SHEAR = 1.05, 0.05
FRAMES = 60
CENTRAL = (*TETRAHEDRAL, "springs", "volume_springs")
"""Laws that should conserve angular momentum. The laws of chapter 4 are omitted, because they also exert
forces perpendicular to an edge."""
ROUND_OFF = 1e-5
"""Largest relative change of a momentum that counts as round-off. Float32 causes changes of about 1e-7,
torques cause changes of 1e-2 or more."""


def points(effort: Effort) -> list[Point]:
    """List the points: every law, undamped and damped."""
    seconds = 1.0 if effort is Effort.QUICK else 5.0
    return [
        {"law": law, "damping": damping, "seconds": seconds}
        for law in laws_of(effort)
        for damping in (0.0, DAMPING)
    ]


def measure(point: Point) -> Numbers:
    """Measure the largest relative change of momentum and angular momentum; -1 if the body fails."""
    mesh = box(SIZE, CELLS)
    material = Material(YOUNG, POISSON, DENSITY, point["damping"], damping_ratio=0.0)
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(mesh, material, law=point["law"])
    world.build()
    start = mesh.vertices * (STRETCH, 1.0, 1.0) + SHEAR * mesh.vertices[:, [2, 0, 1]]
    body.set_motion(start, VELOCITY + np.cross(SPIN, start))
    first = _momenta(body.masses, body.positions(), body.velocities())
    dt = point["seconds"] / FRAMES
    substeps = 2 * world.stable_substeps(dt)  # at the limit, undamped bodies are unstable under some laws
    changes = np.zeros((FRAMES + 1, 2))
    turning = np.ones(FRAMES + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)  # the result -1 reports a frozen body
        for frame in range(1, FRAMES + 1):
            world.step(dt, substeps)
            if body.is_frozen:
                return {"momentum": -1.0, "angular_momentum": -1.0, "times": [], "turning": []}
            now = _momenta(body.masses, body.positions(), body.velocities())
            changes[frame] = np.linalg.norm(now - first, axis=1) / np.linalg.norm(first, axis=1)
            turning[frame] = now[1] @ first[1] / (first[1] @ first[1])
    momentum, angular_momentum = changes.max(axis=0)
    return {
        "momentum": float(momentum),
        "angular_momentum": float(angular_momentum),
        "times": (dt * np.arange(FRAMES + 1)).round(5).tolist(),
        "turning": turning.round(6).tolist(),
    }


def _momenta(masses: Floats, positions: NDArray[Any], velocities: NDArray[Any]) -> Floats:
    """Return the momentum [N s] and the angular momentum about the centre of mass [N m s], as rows."""
    x, impulses = positions.astype(np.float64), masses[:, None] * velocities.astype(np.float64)
    arms = x - masses @ x / masses.sum()
    return np.stack([impulses.sum(axis=0), np.cross(arms, impulses).sum(axis=0)])


def conclude(results: Results) -> Section:
    """Judge momentum under every law, and angular momentum under the laws in `CENTRAL`."""
    rows = results.where()
    sound = [(p, n) for p, n in rows if n["times"]]
    momentum = max(n["momentum"] for _, n in sound)
    turned = {(p["law"], p["damping"]): n["angular_momentum"] for p, n in sound}
    central = max(change for (law, _), change in turned.items() if law in CENTRAL)
    broken = [f"{p['law']} {'damped' if p['damping'] else 'undamped'}" for p, n in rows if not n["times"]]
    others = {key: change for key, change in turned.items() if key[0] not in CENTRAL}
    told = ", ".join(
        f"{law} {change:.0%} ({'damped' if damping else 'undamped'})"
        for (law, damping), change in others.items()
    )
    are_whole = all((law, damping) in turned for law in TETRAHEDRAL for damping in (0.0, DAMPING))
    agrees = are_whole and momentum < ROUND_OFF and central < ROUND_OFF
    moved = {law for (law, _), change in others.items() if change >= ROUND_OFF}
    moved |= {p["law"] for p, n in rows if not n["times"]}
    finding = judged_but_for(
        "momentum-budget",
        f"momentum changes by {momentum:.1g} of what it was at most under every law, angular momentum by "
        f"{central:.1g} under those on tetrahedra, springs and volume_springs. Laws of chapter 4 do not: "
        + told
        + (f". Broke: {', '.join(broken)}" if broken else ""),
        agrees,
        f"the model: float32 alone would leave less than {ROUND_OFF:g}",
        [law for law in dict.fromkeys(p["law"] for p, _ in rows) if law in moved],
        "their forces across an edge, and their damping, turn a body",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for point, numbers in sound:
            if point["law"] in ("virial", "springs") or point["law"] not in CENTRAL:
                style = "-" if point["damping"] else ":"
                name = f"{point['law']}, {'damped' if point['damping'] else 'undamped'}"
                axes.plot(numbers["times"], numbers["turning"], style, label=name)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("angular momentum, over that at the start [1]")
        axes.set_ylim(-0.1, 2.0)  # a larger change means that the body failed
        figure.legend(loc="outside right upper")

    return Section(
        (
            f"A box of {' x '.join(map(str, SIZE))} m (E = {YOUNG:g} Pa, nu = {POISSON}, {DENSITY:g} "
            "kg/m^3), stretched and sheared by 5 %, flies, tumbles and vibrates without gravity.",
            "Opposite forces on the ends of an edge conserve momentum. They turn the body if they do not "
            "point along the edge, as the shear force of chapter 4. The damping of that chapter (eq. 4.5) "
            "does not distinguish a shear from a rotation, and brakes both.",
        ),
        (finding,),
        (
            Table(
                "changes",
                "Largest changes of momentum and angular momentum. -1: the body broke",
                ("law", "damping [N s/m]", "momentum [1]", "angular momentum [1]"),
                tuple((p["law"], p["damping"], n["momentum"], n["angular_momentum"]) for p, n in rows),
            ),
        ),
        (Plot("turning", "Angular momentum about the axis that it had at the start.", draw, (8.5, 4.2)),),
    )


MOMENTUM_BUDGET = Experiment(
    "momentum-budget",
    "Momentum of a free body",
    "beyond the thesis: mechanics",
    ("momentum-budget",),
    points,
    measure,
    conclude,
)
