"""Cost of drawing the thesis's sphere at 40 FPS (thesis section 6.6)."""

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
from lab.experiments.timing import seconds_of
from taichi_soft import load_mesh, preset
from taichi_soft.core.package_data import ASSETS
from taichi_soft.render import Camera, Renderer, Surface
from taichi_soft.world.bare import bare_world

RATE = 40.0
"""Frame rate of the drawing in the thesis [1/s]."""
SUBSTEPS = 18
"""Number of substeps per frame of 1/40 s. This is 720 substeps per second; the thesis has 700."""
SIZE = 640, 480
HARDLY = 0.1
"""Drawing hardly affects the simulation if it takes at most this fraction of the time."""


def points(effort: Effort) -> list[Point]:
    """List the points: one fall from 7 m with the first bounces."""
    return [{"frames": 40 if effort is Effort.QUICK else 200}]


def measure(point: Point) -> Numbers:
    """Measure the times to step, to read the positions, and to draw in each frame [s]."""
    mesh = load_mesh(ASSETS / "sphere.npz")
    world = bare_world(retries=0)
    body = world.add_body(mesh, preset("thesis_sphere"), position=(0, 0, 7.0), law="virial")
    world.build()
    surface = Surface.of(mesh)
    camera = Camera.framing((-1.5, -1.5, 0.0), (1.5, 1.5, 8.0), aspect=SIZE[0] / SIZE[1])
    renderer = Renderer(*SIZE, camera=camera, floor=0.0)
    out = body.positions()

    def read() -> None:
        body.positions(out=out)

    def draw() -> None:
        surface.positions = out
        renderer.render([surface])

    rows = []
    for _ in range(point["frames"] + 1):
        step = seconds_of(lambda: world.step(1 / RATE, SUBSTEPS))
        rows.append((step, seconds_of(read), seconds_of(draw)))
    steps, reads, draws = (list(column) for column in zip(*rows[1:], strict=True))  # the first frame compiles
    return {"step": steps, "read": reads, "draw": draws, "tets": len(mesh.tets)}


def conclude(results: Results) -> Section:
    """Judge the fraction of the time that drawing takes at 40 FPS."""
    numbers = results.one()
    step, read, draw = (float(np.median(numbers[key])) for key in ("step", "read", "draw"))
    reading, drawing = RATE * read, RATE * (read + draw)
    measured = (
        f"at {RATE:.0f} frames a second reading the positions takes {reading:.2%} of the time, and drawing "
        f"{SIZE[0]} x {SIZE[1]} pixels by this processor takes {drawing:.0%}: {1e3 * draw:.2g} ms a frame, "
        f"beside {1e3 * step:.2g} ms for the steps of 1/{RATE:.0f} s. Tolerance: up to {HARDLY:.0%} counts "
        "as hardly"
    )
    if drawing < HARDLY:
        finding = Finding("refresh-rate", measured, Verdict.AGREES)
    elif reading < HARDLY:
        why = (
            "a graphics card of 2003 drew the thesis's frames, and none is at hand. The simulation's own "
            "part, to hand over the positions, is within the tolerance"
        )
        finding = Finding("refresh-rate", measured, Verdict.UNKNOWN, why)
    else:
        why = "handing over the positions alone takes that much of the time"
        finding = Finding("refresh-rate", measured, Verdict.DIFFERS, why)

    def plot(figure: Any) -> None:
        axes = figure.add_subplot()
        for key, label in (("step", "steps of 1/40 s"), ("draw", "drawing"), ("read", "reading positions")):
            axes.semilogy(1e3 * np.array(numbers[key]), label=label)
        axes.axhline(1e3 / RATE, linestyle=":", color="grey", label="1/40 s")
        axes.set_xlabel("frame [1]")
        axes.set_ylabel("time [ms]")
        axes.legend(fontsize="small", ncols=2)

    return Section(
        (
            "The thesis's sphere falls and bounces, and every frame of 1/40 s is drawn. The renderer of this "
            "project draws with the processor, without a graphics card.",
        ),
        (finding,),
        (
            Table(
                "frames",
                "Time of a frame",
                ("part", "median [ms]", "share of the time at 40 Hz [1]"),
                (
                    ("steps of 1/40 s", float(f"{1e3 * step:.3g}"), "-"),
                    ("reading positions", float(f"{1e3 * read:.3g}"), float(f"{reading:.3g}")),
                    ("drawing", float(f"{1e3 * draw:.3g}"), float(f"{RATE * draw:.3g}")),
                ),
            ),
        ),
        (Plot("frames", "Time of each part, frame by frame.", plot),),
    )


REFRESH_RATE = Experiment(
    "refresh-rate",
    "Drawing at 40 Hz",
    "section 6.6",
    ("refresh-rate",),
    points,
    measure,
    conclude,
    is_timing=True,
)
"""The experiment on drawing at 40 FPS."""
