"""A body whose density increases to the right is dropped (thesis figure 6.3).

The thesis claims that the heavy side is compressed most, leaves the floor last and rises least. For
comparison, a body of equal mass with uniform density is dropped. Its sides must not differ.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.experiment import (
    Effort,
    Experiment,
    Finding,
    Numbers,
    Picture,
    Plot,
    Point,
    Results,
    Section,
    Table,
    Verdict,
)
from taichi_soft import Material, TetMesh, box
from taichi_soft.world.bare import bare_world

SIZE = (3.0, 1.5, 1.5)  # edges of the body [m]
LIGHT, HEAVY, YOUNG, POISSON, DAMPING = 200.0, 2000.0, 4e5, 0.2, 20.0
DROP = 3.0  # initial height of the body's lower face [m]
DT, SUBSTEPS = 0.01, 10
TOUCH = 1e-3  # height below which a vertex counts as lying on the floor [m]


def points(effort: Effort) -> list[Point]:
    """List the points: increasing and uniform density. A full report adds both on a finer mesh."""
    cells = (4,) if effort is Effort.QUICK else (4, 6)
    return [{"density": kind, "cells": count} for count in cells for kind in ("grows", "mean")]


def block(cells: int) -> TetMesh:
    """Make a block centred at the origin, with `cells` cells along its height."""
    mesh = box(SIZE, (2 * cells, cells, cells))
    return mesh.translated(-np.mean(mesh.bounds, axis=0))


def density_of(mesh: TetMesh, kind: str) -> NDArray[np.float64]:
    """Return the density of each tetrahedron [kg/m^3]; `kind` is "grows" or "mean"."""
    right = mesh.vertices[mesh.tets].mean(axis=1)[:, 0] / SIZE[0] + 0.5
    share = right if kind == "grows" else np.full(len(mesh.tets), 0.5)
    return LIGHT + (HEAVY - LIGHT) * share


def measure(point: Point) -> Numbers:
    """Measure the height of the lower edge and the thickness of each end over time, and store four poses."""
    mesh = block(point["cells"])
    substeps = SUBSTEPS * point["cells"] // 4
    world = bare_world(retries=0)
    material = Material(YOUNG, POISSON, density_of(mesh, point["density"]), DAMPING, damping_ratio=0.0)
    body = world.add_body(mesh, material, position=(0, 0, DROP + SIZE[2] / 2), law="virial")
    world.build()
    x, z = mesh.vertices[:, 0], mesh.vertices[:, 2]
    ends = {"left": x < x.min() + 1e-6, "right": x > x.max() - 1e-6}
    low, high = z < z.min() + 1e-6, z > z.max() - 1e-6
    series: dict[str, list[float]] = {"time": []}
    for end in ends:
        series |= {f"{end}_height": [], f"{end}_thickness": []}
    frames = []
    for _ in range(230):
        world.step(DT, substeps)
        now = body.positions().astype(np.float64)
        series["time"].append(world.time)
        for end, here in ends.items():
            series[f"{end}_height"].append(float(now[here & low, 2].mean()))
            thickness = np.linalg.norm(now[here & high].mean(axis=0) - now[here & low].mean(axis=0))
            series[f"{end}_thickness"].append(float(thickness))
        frames.append(np.round(now, 3))
    first, second = sorted(round(side(series, end)["leaves"] / DT) - 1 for end in ends)
    pressed = int(np.argmin(np.add(series["left_thickness"], series["right_thickness"])[: second + 1]))
    chosen = (pressed, first, second, min(second + 25, len(frames) - 1))
    return {
        **series,
        "poses": [frames[i].tolist() for i in chosen],
        "moments": [(i + 1) * DT for i in chosen],
    }


def side(numbers: Numbers, end: str) -> dict[str, float]:
    """Measure the "left" or the "right" end.

    Returns: "pressed", relative compression in the first contact; "leaves", time at which the end leaves the
        floor [s]; "rises", largest height of the end's lower edge before the body touches down again [m].
    """
    height, thickness = np.array(numbers[f"{end}_height"]), np.array(numbers[f"{end}_thickness"])
    other = np.array(numbers["left_height" if end == "right" else "right_height"])
    touched = int(np.argmax(height < TOUCH))
    after = np.flatnonzero((height[touched:] > TOUCH) & (other[touched:] > TOUCH))
    lift = touched + int(after[0]) if len(after) else len(height) - 1  # both ends are in the air
    own = touched + int(np.argmax(height[touched:] > TOUCH))
    down = np.flatnonzero(np.minimum(height, other)[lift:] < TOUCH)
    again = lift + int(down[0]) if len(down) else len(height)
    return {
        "pressed": 1.0 - float(thickness[touched : max(lift, touched + 1)].min()) / SIZE[2],
        "leaves": float(numbers["time"][own]),
        "rises": float(height[lift:again].max(initial=0.0)),
    }


def conclude(results: Results) -> Section:
    """Judge whether the heavy side is compressed more, leaves the floor later, and rises less."""
    grows, even = (results.one(density=kind, cells=4) for kind in ("grows", "mean"))
    light, heavy = side(grows, "left"), side(grows, "right")
    most = heavy["pressed"] > light["pressed"]
    last = heavy["leaves"] > light["leaves"]
    least = heavy["rises"] < light["rises"]
    twins = [
        abs(side(even, "left")[key] - side(even, "right")[key]) for key in ("pressed", "leaves", "rises")
    ]
    measured = (
        f"the heavy side is pressed by {100 * heavy['pressed']:.0f} %, the light one by "
        f"{100 * light['pressed']:.0f} %; it leaves the floor after {heavy['leaves']:.2f} s, the other after "
        f"{light['leaves']:.2f} s, and rises to {heavy['rises']:.2f} m, the other to {light['rises']:.2f} m"
    )
    agrees = most and last and least
    names = (("pressed most", most), ("last", last), ("least", least))
    why = (
        "" if agrees else "the heavy side is not " + ", nor ".join(name for name, holds in names if not holds)
    )
    if why:
        why += (
            f"; with the mean density everywhere the sides differ by {twins[0]:.2g} in pressing, "
            f"{twins[1]:.2g} s and {twins[2]:.2g} m, so this is the density's doing, not the mesh's"
        )
    rows = tuple(
        (p["density"], p["cells"], end, *(round(value, 3) for value in side(n, end).values()))
        for p, n in results.where()
        for end in ("left", "right")
    )
    columns = ("density", "cells high", "end", "pressed [1]", "leaves the floor [s]", "rises to [m]")
    return Section(
        (
            f"A block of {SIZE[0]:g} x {SIZE[1]:g} x {SIZE[2]:g} m falls level by {DROP:g} m. Its density "
            f"grows from {LIGHT:g} kg/m^3 on the left to {HEAVY:g} on the right.",
        ),
        (Finding("density-bounce", measured, Verdict.AGREES if agrees else Verdict.DIFFERS, why),),
        (Table("sides", "Both ends in the first bounce", columns, rows),),
        (
            Plot(
                "sides",
                "Thickness of both ends, and the height of their bottoms: the light end leaves first.",
                lambda figure: _draw(figure, grows),
                (6.4, 5.0),
            ),
        ),
        tuple(_pictures(grows)),
    )


def _draw(figure: Any, numbers: Numbers) -> None:
    thickness, height = figure.subplots(2, 1, sharex=True)
    for end, label in (("left", "light, left"), ("right", "heavy, right")):
        thickness.plot(numbers["time"], numbers[f"{end}_thickness"], label=label)
        height.plot(numbers["time"], numbers[f"{end}_height"], label=label)
    thickness.set_ylabel("thickness [m]")
    height.set_ylabel("height of the bottom [m]")
    height.set_xlabel("time [s]")
    thickness.legend()


def _pictures(numbers: Numbers) -> list[Picture]:
    from lab.experiments.pictures import picture

    said = ("pressed most", "one end leaves the floor", "the other end leaves it", "a quarter second later")
    mesh = block(4)
    return [
        Picture(
            f"density-{i}",
            f"{words}, t = {moment:.2f} s; the heavy end is on the right",
            picture([(mesh, np.array(pose))], True),
        )
        for i, (words, moment, pose) in enumerate(
            zip(said, numbers["moments"], numbers["poses"], strict=True), start=1
        )
    ]


DENSITY_BOUNCE = Experiment(
    "density-bounce",
    "A body that grows denser to the right",
    "figure 6.3",
    ("density-bounce",),
    points,
    measure,
    conclude,
)
