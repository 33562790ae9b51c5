"""Gain of implicit Euler for tetrahedra (thesis section 6.5): computing time compared with leapfrog.

A sphere falls onto the floor. A stiffer sphere needs shorter steps with leapfrog but not with implicit Euler,
so the gain grows with the stiffness. Therefore three materials are compared.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.cmpm_drop import BOUNCE, FRAMES, MATERIAL, Drop, bounces, fall, is_whole, rebound
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
from lab.experiments.timing import in_turns
from taichi_soft import Material

THESIS = "of the thesis's sphere"
BODIES: dict[str, tuple[Material, tuple[float, ...]]] = {
    THESIS: (Material(1e6, 0.1, 1000.0, 100.0, damping_ratio=0.0), (3.0, 7.0, 15.0)),
    "stiff": (Material(1e8, 0.3, 1000.0, 1000.0, damping_ratio=0.0), (10.0, 30.0, 100.0)),
    "very stiff": (MATERIAL, (10.0, 100.0, 300.0)),
}
"""Material of each sphere, and lengths of its steps with implicit Euler [leapfrog's largest stable step]. The
longest step is about as long as a frame."""

EXPLICIT = 0.9
"""Length of a leapfrog step, as a fraction of the largest stable step."""
PAYS = 1.5
"""Smallest gain that counts as an advantage; smaller gains may be noise on a busy machine."""


def points(effort: Effort) -> list[Point]:
    """List the points: a fall for each sphere, integrator and step.

    A quick report uses a coarse mesh and omits the stiffest sphere.
    """
    is_full = effort is Effort.FULL
    common = {"resolution": 5 if is_full else 3, "repeats": 3 if is_full else 2}
    names = list(BODIES) if is_full else list(BODIES)[:2]
    return [
        {"body": name, "integrator": integrator, "factor": factor, **common}
        for name in names
        for integrator, factors in (("leapfrog", (EXPLICIT,)), ("implicit_euler", BODIES[name][1]))
        for factor in factors
    ]


def measure(point: Point) -> Numbers:
    """Measure a fall. For implicit Euler, also time the same fall with both integrators in alternation.

    The time of a fall is the sum of the shortest times of its frames [s].
    """
    material, resolution = BODIES[point["body"]][0], point["resolution"]

    def drop(integrator: Any, factor: float) -> Drop:
        return Drop(integrator, factor, resolution, law="virial", material=material)

    found = fall(drop(point["integrator"], point["factor"]))
    if point["integrator"] == "leapfrog":
        return found
    turns = [
        in_turns(drop("leapfrog", EXPLICIT).frame, drop("implicit_euler", point["factor"]).frame, FRAMES)
        for _ in range(point["repeats"])
    ]
    slow, fast = np.array(turns).min(axis=0)
    return {**found, "explicit": float(slow.sum()), "implicit": float(fast.sum())}


def conclude(results: Results) -> Section:
    """Judge whether a fall with implicit Euler that keeps its bounce is faster than one with leapfrog."""
    rows = []
    for point, numbers in results.where(integrator="implicit_euler"):
        name, factor = point["body"], point["factor"]
        reference = results.one(body=name, integrator="leapfrog")["height"]
        gain = numbers["explicit"] / numbers["implicit"]
        whole = is_whole(numbers, reference)
        sound = whole and bounces(numbers, reference)
        kept = rebound(numbers["height"]) / rebound(reference)
        rows.append((name, factor, numbers, gain, kept, whole, sound))
    names = list(dict.fromkeys(name for name, *_ in rows))
    best = {
        name: max((gain for n, _, _, gain, _, _, sound in rows if n == name and sound), default=0.0)
        for name in names
    }
    paying = [name for name, gain in best.items() if gain >= PAYS]
    told = "; ".join(
        f"{name} (E = {float(np.max(BODIES[name][0].young)):.0e} Pa): "
        + ", ".join(
            f"{gain:.2g} times with a step of {1e3 * n['step']:.2g} ms"
            + (f" ({kept:.0%} of the bounce)" if whole else " (not whole)")
            for other, _, n, gain, kept, whole, _ in rows
            if other == name
        )
        for name in names
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for number, name in enumerate(names):
            own = [(factor, gain, sound) for n, factor, _, gain, _, _, sound in rows if n == name]
            axes.loglog([f for f, _, _ in own], [g for _, g, _ in own], f"C{number}-", label=name)
            for factor, gain, sound in own:
                filling = f"C{number}" if sound else "white"
                axes.loglog(factor, gain, f"C{number}o", markerfacecolor=filling, markersize=8)
        axes.axhline(1.0, linestyle=":", color="grey")
        axes.set_xlabel("step over leapfrog's largest stable one [1]")
        axes.set_ylabel("time of leapfrog over that of implicit Euler [1]")
        axes.legend()

    return Section(
        (
            "A sphere of the virial law falls half a metre onto the floor. Both integrators run in turns: "
            f"leapfrog with {EXPLICIT} of its largest stable step, implicit Euler with longer ones. A fall "
            f"is sound if the sphere stays whole and keeps {BOUNCE:g} of the bounce or more.",
        ),
        (
            judged_but_for(
                "implicit-tetrahedra",
                f"speed of implicit Euler over that of leapfrog: {told}. Tolerance: it pays if a fall that "
                f"keeps {BOUNCE:g} of the bounce is at least {PAYS:g} times faster",
                THESIS not in paying,
                "here the gradients cost less than the longer steps save",
                [f"the {name} sphere" for name in paying],
                "leapfrog needs such short steps there that implicit Euler is "
                + " and ".join(f"{best[name]:.2g}" for name in paying)
                + " times faster with a bounce kept",
            ),
        ),
        (
            Table(
                "falls",
                "Falls with implicit Euler",
                (
                    "sphere",
                    "step [ms]",
                    "over leapfrog's limit [1]",
                    "times faster [1]",
                    "bounce kept [1]",
                    "whole",
                    "sound",
                ),
                tuple(
                    (name, f"{1e3 * n['step']:.3g}", factor, f"{gain:.3g}", f"{kept:.2f}", whole, sound)
                    for name, factor, n, gain, kept, whole, sound in rows
                ),
            ),
        ),
        (
            Plot(
                "gains",
                "Gain of implicit Euler over leapfrog. Filled: falls that keep their bounce. Open: falls "
                "that lose it.",
                draw,
            ),
        ),
    )


IMPLICIT_TETRAHEDRA = Experiment(
    "implicit-tetrahedra",
    "Implicit Euler for tetrahedra",
    "section 6.5",
    ("implicit-tetrahedra",),
    points,
    measure,
    conclude,
    is_timing=True,
)
"""The experiment on implicit Euler for tetrahedra."""
