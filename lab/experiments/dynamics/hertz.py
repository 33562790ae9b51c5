"""An elastic sphere pressed onto a rigid plane: force against depth, after Hertz 1881 (not in the thesis).

There are two references: Hertz's formula for a smooth sphere and small depths, and finite elements with
contact on the same mesh. The mesh is refined at the contact, because too few vertices of an even mesh would
touch the plane.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.dynamics.compared_laws import TETRAHEDRAL
from lab.experiments.dynamics.contact_elements import contact_forces
from lab.experiments.dynamics.pressed_sphere import (
    DEPTHS,
    GRADED,
    MATERIAL,
    RADIUS,
    cap,
    graded_sphere,
    hertz_force,
    press_on_floor,
    press_plane,
)
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

COARSE, FINE = 6, 8  # cells along the radius
ELEMENTS = "finite elements"
QUICK_LAWS, FULL_LAWS = ("virial", "neo_hookean", "springs"), (*TETRAHEDRAL, "springs", "volume_springs")
EXPONENT, EXPONENT_TOLERANCE = 1.5, 0.1
FROM_HERTZ = 0.1
"""Largest relative difference from Hertz's force at any depth. Finite elements differ from Hertz's force by 8
%, because at first only a few vertices touch the plane."""
SAME_MESH = 0.03
"""Largest relative difference from finite elements at the smallest depth. Finite elements assume small
strain. The strain below the contact is about sqrt(depth / radius) / 2, which is 4 to 10 %."""


def points(effort: Effort) -> list[Point]:
    """List the points: some laws and finite elements on the graded mesh, and finite elements on an even mesh.

    A full report adds more laws, a finer mesh, and a collider in place of the floor.
    """
    laws = QUICK_LAWS if effort is Effort.QUICK else FULL_LAWS
    rows = [(law, COARSE, GRADED, "floor") for law in (*laws, ELEMENTS)]
    rows += [(ELEMENTS, COARSE, 0.0, "floor")]
    if effort is Effort.FULL:
        rows += [(law, FINE, GRADED, "floor") for law in ("virial", "neo_hookean", "springs", ELEMENTS)]
        rows += [("virial", COARSE, GRADED, "collider")]
    return [dict(zip(("law", "pieces", "grading", "plane"), row, strict=True)) for row in rows]


def measure(point: Point) -> Numbers:
    """Measure the force at each depth [N] and its exponent: the slope of log(force) over log(depth)."""
    mesh = graded_sphere(point["pieces"], point["grading"])
    if point["law"] == ELEMENTS:
        forces = contact_forces(mesh, MATERIAL, cap(mesh), [RADIUS * depth for depth in DEPTHS])
    elif point["plane"] == "collider":
        forces = press_plane(mesh, point["law"])
    else:
        forces = press_on_floor(mesh, point["law"])
    exponent = np.polyfit(np.log(DEPTHS), np.log(forces), 1)[0]
    return {"forces": forces, "exponent": float(exponent), "tets": len(mesh.tets)}


def conclude(results: Results) -> Section:
    """Compare the forces with Hertz and with finite elements."""
    rows = results.where()
    hertz = np.array([hertz_force(RADIUS * depth) for depth in DEPTHS])
    elements = results.one(law=ELEMENTS, pieces=COARSE, grading=GRADED)
    even = np.array(results.one(law=ELEMENTS, pieces=COARSE, grading=0.0)["forces"]) / hertz
    same = results.where(pieces=COARSE, grading=GRADED, plane="floor")
    solid = [numbers for point, numbers in same if point["law"] in TETRAHEDRAL]
    springs = np.array(results.one(law="springs", pieces=COARSE)["forces"]) / hertz
    from_hertz = max(float(np.abs(np.array(numbers["forces"]) / hertz - 1).max()) for numbers in solid)
    at_first = max(abs(numbers["forces"][0] / elements["forces"][0] - 1) for numbers in solid)
    at_last = max(abs(numbers["forces"][-1] / elements["forces"][-1] - 1) for numbers in solid)
    drawn = np.array(elements["forces"]) / hertz
    exponents = [numbers["exponent"] for numbers in solid]
    off = max(abs(exponent - EXPONENT) for exponent in exponents)
    others = [point["law"] for point, n in same if point["law"] not in (*TETRAHEDRAL, ELEMENTS)]
    off_hertz = {law: np.array(results.one(law=law, pieces=COARSE)["forces"]) / hertz - 1 for law in others}
    agrees = from_hertz < FROM_HERTZ and off < EXPONENT_TOLERANCE and at_first < SAME_MESH
    finding = judged_but_for(
        "hertz",
        f"for depths of {DEPTHS[0]:g} to {DEPTHS[-1]:g} R laws on tetrahedra are within {from_hertz:.1%} of "
        f"Hertz, with an exponent of {min(exponents):.2f} to {max(exponents):.2f} (1.5; finite elements on "
        f"the same mesh {elements['exponent']:.2f}), and at the smallest depth within {at_first:.1%} of "
        f"these; springs press with {springs.min():.2f} to {springs.max():.2f} of Hertz's force",
        agrees,
        _why(at_first, elements, hertz),
        [law for law, part in off_hertz.items() if np.abs(part).max() >= FROM_HERTZ],
        f"they are off by {FROM_HERTZ:.0%} or more",
    )

    def draw_forces(figure: Any) -> None:
        axes = figure.add_subplot()
        axes.loglog(RADIUS * 1e3 * np.array(DEPTHS), hertz, "k-", lw=1, label="Hertz")
        for point, numbers in same:
            style = "x:" if point["law"] == ELEMENTS else "o--"
            axes.loglog(RADIUS * 1e3 * np.array(DEPTHS), numbers["forces"], style, ms=4, label=point["law"])
        axes.set_xticks(RADIUS * 1e3 * np.array(DEPTHS), [f"{RADIUS * 1e3 * depth:g}" for depth in DEPTHS])
        axes.minorticks_off()
        axes.set_xlabel("depth [mm]")
        axes.set_ylabel("force [N]")
        axes.legend(fontsize=8)

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for point, numbers in rows:
            if point["plane"] == "floor":
                mesh = f"{point['pieces']} pieces, {'graded' if point['grading'] else 'even'}"
                style = "x:" if point["law"] == ELEMENTS else "o-"
                parts = np.array(numbers["forces"]) / hertz
                axes.semilogx(DEPTHS, parts, style, ms=4, label=f"{point['law']} ({mesh})")
        axes.axhline(1, color="black", lw=1)
        axes.set_xlabel("depth over radius [1]")
        axes.set_ylabel("force over Hertz's [1]")
        axes.set_xticks(DEPTHS, [f"{depth:g}" for depth in DEPTHS])
        axes.minorticks_off()
        axes.set_ylim(0, 2.4)
        axes.legend(fontsize=7, ncols=2, loc="upper right")

    return Section(
        (
            f"A sphere of {RADIUS} m (E = 1e6 Pa, nu = 0.3), whose upper half is held, is pressed on "
            "a rigid plane without friction, and comes to rest at each depth. The force is that on the held "
            "part. Hertz measures the depth from far away. Finite elements have the same held part.",
            "A sphere of facets touches the plane with single vertices. While only a few of them touch, "
            f"the force jumps about Hertz's. On an even mesh of {elements['tets']} tetrahedra finite "
            f"elements have {even.min():.2f} to {even.max():.2f} times his force. On the same mesh, refined "
            "towards the contact by a Moebius map until its edges there are a quarter as long, they have "
            f"{drawn.min():.2f} to {drawn.max():.2f} times his force. The difference between finite "
            f"elements and the laws grows from {at_first:.1%} to {at_last:.1%} with the depth, because the "
            "strain under the contact is no longer small.",
            "Laws of chapter 4 are left out, because they need a Delaunay mesh.",
        ),
        (finding,),
        (
            Table(
                "forces",
                "Force over Hertz's at each depth",
                (
                    *("law", "tetrahedra", "mesh", "pressed by"),
                    *(f"{depth:g} R [1]" for depth in DEPTHS),
                    "exponent [1]",
                ),
                tuple(
                    (
                        *(p["law"], n["tets"], "graded" if p["grading"] else "even", p["plane"]),
                        *(np.array(n["forces"]) / hertz).tolist(),
                        n["exponent"],
                    )
                    for p, n in rows
                ),
            ),
        ),
        (
            Plot("forces", "Force against depth on the graded mesh.", draw_forces),
            Plot("parts", "Force over Hertz's. Even mesh: too few vertices touch.", draw, (6.4, 4.6)),
        ),
    )


def _why(at_first: float, elements: Numbers, hertz: Any) -> str:
    """Name the cause of a deviation.

    The cause is the mesh if finite elements also deviate and the laws agree with finite elements. Otherwise
    the cause is the model.
    """
    left = float(np.abs(np.array(elements["forces"]) / hertz - 1).max())
    if at_first < SAME_MESH and left > FROM_HERTZ / 2:
        return f"the mesh: finite elements on it are off by up to {left:.1%}, and the laws are near to these"
    return (
        f"the model: finite elements on the same mesh are off by {left:.1%} at most, and the laws differ "
        f"from them by {at_first:.1%} at the smallest depth"
    )


HERTZ = Experiment(
    "hertz",
    "A sphere pressed on a plane",
    "beyond the thesis: Hertz 1881",
    ("hertz",),
    points,
    measure,
    conclude,
)
