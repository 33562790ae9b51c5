"""Leapfrog is reversible (thesis section 3.5.2): with all velocities reversed, a body returns to its start.

Between steps, positions and velocities of a World belong to the same time, so a run can be reversed after any
step. The body does not return exactly, because of round-off, and because some integrators lose information.
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
from taichi_soft import Material, box
from taichi_soft.world.bare import bare_world

INTEGRATORS = ("explicit_euler", "lazy_leapfrog", "leapfrog", "implicit_euler")
MATERIAL = Material(
    young=1e5, poisson=0.3, density=1000.0, damping_ratio=0.0
)  # undamped, because damping is irreversible
STRETCH, DT, SUBSTEPS = 1.1, 1 / 60, 8
REVERSIBLE = 1e-4
"""An integrator is reversible if the remaining distance is at most this fraction of the distance travelled.
Round-off leaves a few millionths, irreversible integrators leave more than a hundredth."""


def points(effort: Effort) -> list[Point]:
    """List the points: explicit integrators over 0.1 s, or all integrators over 0.5 s."""
    steps, names = (6, INTEGRATORS[:3]) if effort is Effort.QUICK else (30, INTEGRATORS)
    return [{"integrator": name, "steps": steps} for name in names]


def measure(point: Point) -> Numbers:
    """Measure the distance of a stretched cube from its start after steps forwards and as many backwards."""
    cube = box(cells=(2, 2, 2))
    world = bare_world(gravity=(0, 0, 0), floor=None, integrator=point["integrator"], retries=0)
    body = world.add_body(cube, MATERIAL, law="virial")
    world.build()
    start = (cube.vertices * (STRETCH, 1.0, 1.0)).astype(np.float32)
    body.set_motion(start, np.zeros_like(start))
    out = 0.0
    for _ in range(point["steps"]):
        world.step(DT, SUBSTEPS)
        out = max(out, float(np.abs(body.positions() - start).max()))
    body.set_motion(body.positions(), -body.velocities())
    for _ in range(point["steps"]):
        world.step(DT, SUBSTEPS)
    return {"out": out, "left": float(np.abs(body.positions() - start).max())}


def conclude(results: Results) -> Section:
    """Judge whether only leapfrog returns to the start."""
    shares = {}
    for row in results.rows:
        numbers = results.one(**row.point)
        shares[row.point["integrator"]] = numbers["left"] / numbers["out"]
    others = min(share for name, share in shares.items() if name != "leapfrog")
    agrees = shares["leapfrog"] < REVERSIBLE < others

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        axes.bar(list(shares), list(shares.values()))
        axes.set_yscale("log")
        axes.set_ylabel("way left, over way out [1]")

    return Section(
        ("A stretched cube is released, and after some steps all velocities are reversed.",),
        (
            Finding(
                "leapfrog-reversible",
                f"after as many steps back {shares['leapfrog']:.1g} of the way out is left; "
                f"with other integrators {others:.2g} or more",
                Verdict.AGREES if agrees else Verdict.DIFFERS,
                ""
                if agrees
                else "the implementation: leapfrog's equations are the same with time turned round",
            ),
        ),
        (
            Table(
                "ways",
                "Way left after the way back",
                ("integrator", "over the way out [1]"),
                tuple(shares.items()),
            ),
        ),
        (Plot("ways", "What is left of the way out after as many steps back.", draw),),
    )


REVERSAL = Experiment(
    "leapfrog-reversal",
    "Running backwards",
    "section 3.5.2",
    ("leapfrog-reversible",),
    points,
    measure,
    conclude,
)
