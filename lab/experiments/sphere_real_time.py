"""Real-time factor of the thesis's sphere on this machine (section 6.6): simulated time / real time.

The time of a frame of 1/50 s is measured. It consists of 14 steps of 1/700 s, and of reading the positions
for drawing.
"""

from __future__ import annotations

import time
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
from taichi_soft import device, load_mesh, preset
from taichi_soft.core.package_data import ASSETS
from taichi_soft.world.bare import bare_world

DT, SUBSTEPS = 1 / 50, 14
THESIS_FACTOR, THESIS_TETS = 0.45, 955
"""Real-time factor that the thesis reports for an AMD XP 1800+ at 1.53 GHz (section 6.6), and number of
tetrahedra of the thesis's sphere."""


def points(effort: Effort) -> list[Point]:
    """List the points: one fall from 7 m with some bounces."""
    return [{"seconds": 3.0 if effort is Effort.QUICK else 20.0}]


def measure(point: Point) -> Numbers:
    """Measure the time of each frame [s]."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = bare_world(retries=0)
    body = world.add_body(mesh, preset("thesis_sphere"), position=(0, 0, 7.0), law="virial")
    world.build()
    out = body.positions()
    world.step(DT, SUBSTEPS)
    frames = []
    for _ in range(round(point["seconds"] / DT)):
        start = time.perf_counter()
        world.step(DT, SUBSTEPS)
        body.positions(out=out)
        frames.append(time.perf_counter() - start)
    return {
        "frames": frames,
        "tets": len(mesh.tets),
        "threads": device().threads,
        "flipped": body.flipped_count(),
        "frozen": body.is_frozen,
    }


def real_time_factor(numbers: Numbers) -> float:
    """Return the simulated time of all frames divided by their real time."""
    return DT * len(numbers["frames"]) / float(np.sum(numbers["frames"]))


def nanoseconds(factor: float, tets: int) -> float:
    """Return the time per tetrahedron and step [ns]."""
    return 1e9 / (factor * tets * SUBSTEPS / DT)


def conclude(results: Results) -> Section:
    """Compare the real-time factor with that of the thesis. No verdict is possible on another processor."""
    numbers = results.one()
    factor, tets = real_time_factor(numbers), numbers["tets"]
    here, there = nanoseconds(factor, tets), nanoseconds(THESIS_FACTOR, THESIS_TETS)
    threads = "one thread" if numbers["threads"] == 1 else f"{numbers['threads']} threads"
    measured = (
        f"{factor:.3g} times real time here on {threads} ({tets} tetrahedra), {factor / THESIS_FACTOR:.3g} "
        f"times the thesis's {THESIS_FACTOR}"
    )
    why = (
        "the sphere became non-finite during the run"
        if numbers["frozen"]
        else "the claim is about an AMD XP 1800+ of 2002, and no rate on another processor can confirm it or "
        f"contradict it. A tetrahedron and step takes {here:.3g} ns here, and took {there:.3g} ns there"
    )
    finding = Finding("sphere-real-time", measured, Verdict.UNKNOWN, why)
    median = float(np.median(numbers["frames"]))
    rows = (
        ("here", tets, float(f"{factor:.3g}"), float(f"{here:.3g}"), float(f"{1e3 * median:.3g}")),
        ("thesis", THESIS_TETS, THESIS_FACTOR, float(f"{there:.3g}"), "-"),
    )
    columns = (
        "where",
        "tetrahedra",
        "of real time [1]",
        "a tetrahedron and step [ns]",
        "median frame of 20 ms [ms]",
    )
    return Section(
        (
            "The thesis's sphere falls and bounces in frames of 20 ms, as in a program that draws it. A "
            "processor of 2002 is not at hand, so that this compares rates and does not test the claim.",
        ),
        (finding,),
        (Table("rates", "Simulated over real time", columns, rows),),
        (
            Plot(
                "frames",
                "Time of each frame of 20 ms; dashes: the time that the thesis's machine needed.",
                lambda figure: _draw(figure, numbers),
            ),
        ),
    )


def _draw(figure: Any, numbers: Numbers) -> None:
    axes = figure.add_subplot()
    axes.plot(DT * np.arange(1, len(numbers["frames"]) + 1), 1e3 * np.array(numbers["frames"]))
    axes.axhline(1e3 * DT / THESIS_FACTOR, linestyle="--", color="gray")
    axes.set_yscale("log")
    axes.set_xlabel("simulated time [s]")
    axes.set_ylabel("time of a frame [ms]")


SPHERE_REAL_TIME = Experiment(
    "sphere-real-time",
    "The sphere against real time",
    "section 6.6",
    ("sphere-real-time",),
    points,
    measure,
    conclude,
    is_timing=True,
)
