"""A pressure pulse travels along a long bar under every law (not in the thesis).

The bar starts at rest. Its free end is displaced along the axis in the shape of half a bell curve. By
d'Alembert's formula, half of this displacement travels away as a bell-shaped pulse. The speed of the pulse is
sqrt(E / rho) if the bar is thin compared with the pulse.
"""

from __future__ import annotations

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
from taichi_soft import Material, box
from taichi_soft.world.bare import bare_world

Floats = NDArray[np.float64]

LENGTH, THICKNESS = 8.0, 0.2  # [m]
WIDTH = 0.8  # standard deviation of the bell [m]; Love's correction for lateral inertia is below 0.1 %
HEIGHT = 0.008  # height of the bell [m]; strains stay below 0.6 %
YOUNG, DENSITY = 1e6, 1000.0
POISSONS = (0.3, 0.0)
SPEED = float(np.sqrt(YOUNG / DENSITY))
FRAMES = 60
SHOWN = 5
TOLERANCE = 0.01
"""Largest relative error of the speed due to the mesh, with two cells across the bar."""


def points(effort: Effort) -> list[Point]:
    """List the points: every law for nu = 0.3, laws on tetrahedra also for nu = 0.

    A full report adds some laws on a finer mesh.
    """
    rows: list[Point] = [{"law": law, "poisson": POISSONS[0], "cells": 2} for law in laws_of(effort)]
    rows += [{"law": law, "poisson": POISSONS[1], "cells": 2} for law in TETRAHEDRAL]
    if effort is Effort.FULL:
        rows += [{"law": law, "poisson": POISSONS[0], "cells": 4} for law in (*TETRAHEDRAL, "springs")]
    return rows


def measure(point: Point) -> Numbers:
    """Measure the motion of the pulse.

    Returns: "speed" [m/s]; "scatter", largest distance of the pulse from a uniform motion [m]; "profiles",
        displacements [m] at the "places" along the bar [m], at some "times" [s].
    """
    cells = point["cells"]
    mesh = box((LENGTH, THICKNESS, THICKNESS), (round(LENGTH / THICKNESS) * cells, cells, cells))
    world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
    body = world.add_body(
        mesh, Material(YOUNG, point["poisson"], DENSITY, damping_ratio=0.0), law=point["law"]
    )
    world.build()
    along = mesh.vertices[:, 0] + LENGTH / 2
    bell = HEIGHT * np.exp(-0.5 * (along / WIDTH) ** 2)
    strain = -along / WIDTH**2 * bell
    start = mesh.vertices * (1 - point["poisson"] * strain)[:, None]  # lateral contraction
    start[:, 0] = mesh.vertices[:, 0] + bell
    body.set_motion(start, np.zeros_like(start))
    places, section = np.unique(np.round(along, 9), return_inverse=True)
    share = body.masses / np.bincount(section, body.masses)[section]
    dt = (LENGTH - 3 * WIDTH) / SPEED / FRAMES
    substeps = world.stable_substeps(dt)
    times, profiles = list[float](), list[Floats]()
    for frame in range(1, FRAMES + 1):
        world.step(dt, substeps)
        if frame % 4 == 0:
            moved = body.positions()[:, 0] - mesh.vertices[:, 0]
            times.append(frame * dt)
            profiles.append(np.bincount(section, share * moved).astype(np.float64))
    peaks = np.array([_peak(places, profile) for profile in profiles])
    apart = np.flatnonzero((peaks > 3 * WIDTH) & (peaks < LENGTH - 2 * WIDTH))
    if body.is_frozen or len(apart) < 4:
        return {"speed": 0.0, "scatter": 0.0, "places": [], "times": [], "profiles": []}
    at = np.array(times)[apart]
    speed, begin = np.polyfit(at, peaks[apart], 1)
    shown = np.linspace(0, len(times) - 1, SHOWN).round().astype(int)
    return {
        "speed": float(speed),
        "scatter": float(np.abs(peaks[apart] - begin - speed * at).max()),
        "places": places.round(4).tolist(),
        "times": [round(times[i], 5) for i in shown],
        "profiles": [profiles[i].round(7).tolist() for i in shown],
    }


def _peak(places: Floats, profile: Floats) -> float:
    """Return the position of a bell's maximum [m].

    The function fits a parabola to the values above 0.7 of the largest value.
    """
    top = int(profile.argmax())
    low, high = top, top
    while low > 0 and profile[low - 1] > 0.7 * profile[top]:
        low -= 1
    while high < len(profile) - 1 and profile[high + 1] > 0.7 * profile[top]:
        high += 1
    if high - low < 3:
        return float(places[top])
    square, linear, _ = np.polyfit(places[low : high + 1], profile[low : high + 1], 2)
    return float(-linear / (2 * square)) if square < 0 else float(places[top])


def conclude(results: Results) -> Section:
    """Judge whether laws on tetrahedra have the correct speed."""
    rows = results.where()
    known = {(p["law"], p["poisson"], p["cells"]): n["speed"] / SPEED for p, n in rows}
    errors = [abs(known[law, poisson, 2] - 1) for law in TETRAHEDRAL for poisson in POISSONS]
    others = {law: part for (law, _, cells), part in known.items() if law not in TETRAHEDRAL and cells == 2}
    agrees = max(errors) < TOLERANCE
    told = ", ".join(f"{part:.1%} ({law})" for law, part in others.items())
    finding = judged_but_for(
        "wave-speed",
        f"of sqrt(E / rho) = {SPEED:.2f} m/s the laws on tetrahedra are within {max(errors):.1%}, for "
        f"nu = 0 and 0.3; along edges pulses run at {told}",
        agrees,
        _why(known),
        [law for law, part in others.items() if abs(part - 1) >= TOLERANCE],
        f"their pulses are {TOLERANCE:.0%} or more off",
    )
    waves = results.one(law="virial", poisson=POISSONS[0], cells=2)
    springs = results.one(law="springs", poisson=POISSONS[0], cells=2)

    def draw(figure: Any) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True)
        for axes, numbers, name in ((upper, waves, "virial"), (lower, springs, "springs")):
            for number, (time, profile) in enumerate(zip(numbers["times"], numbers["profiles"], strict=True)):
                color = f"C{number}"
                axes.plot(
                    numbers["places"], 1e3 * np.array(profile), color=color, label=f"{1e3 * time:.0f} ms"
                )
                axes.axvline(SPEED * time, color=color, ls=":", lw=1)
            axes.set_ylabel(f"{name}:\ndisplacement [mm]")
            axes.set_ylim(-1, 1.1e3 * HEIGHT)
        lower.set_xlabel("distance from the free end [m]")
        upper.legend(fontsize=8, ncols=2)

    return Section(
        (
            f"A bar of {LENGTH:g} m, {THICKNESS} m thick (E = {YOUNG:g} Pa, {DENSITY:g} kg/m^3), starts "
            f"undamped with a displacement at one end: half a bell of {WIDTH} m standard deviation and "
            f"{1e3 * HEIGHT:g} mm height. The highest point of the bell is followed along the bar. Its speed "
            "is the slope of a straight line.",
            "A bar this thin widens freely, so that Poisson's ratio does not change its speed. For nu = 0 "
            "the speed is also that of the pressure wave in an unbounded body. The square of the speed "
            "gives the modulus of a law: springs with k = E a / l have "
            f"{(springs['speed'] / SPEED) ** 2:.2f} E.",
        ),
        (finding,),
        (
            Table(
                "speeds",
                "Speed of a pressure pulse",
                (
                    *("law", "nu [1]", "cells across", "speed [m/s]", "over sqrt(E / rho) [1]"),
                    *("modulus it acts with, over E [1]", "largest distance from a straight way [mm]"),
                ),
                tuple(
                    (
                        *(p["law"], p["poisson"], p["cells"], n["speed"], n["speed"] / SPEED),
                        *((n["speed"] / SPEED) ** 2, 1e3 * n["scatter"]),
                    )
                    for p, n in rows
                ),
            ),
        ),
        (
            Plot(
                "pulses",
                "Displacement along the bar at some times; dotted: where a pulse at sqrt(E / rho) would be.",
                draw,
                (6.4, 5.0),
            ),
        ),
    )


def _why(known: dict[tuple[str, float, int], float]) -> str:
    """Name the cause of an error: the mesh if a finer mesh is closer to theory, else the model."""
    coarse, fine = (
        max(abs(known.get((law, POISSONS[0], cells), 0.0) - 1) for law in TETRAHEDRAL) for cells in (2, 4)
    )
    if fine < coarse:
        return f"the mesh: with four cells across the largest error is {fine:.1%}, with two {coarse:.1%}"
    return f"the model: the largest error is {coarse:.1%}, and no finer mesh was seen to do better"


WAVE_SPEED = Experiment(
    "wave-speed",
    "A pressure pulse in a bar",
    "beyond the thesis: linear elasticity",
    ("wave-speed",),
    points,
    measure,
    conclude,
)
