"""One element stretched along many axes (thesis figure 4.5): a regular tetrahedron for the triangle there."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft import Material, TetMesh
from taichi_soft.lab.experiments.directional_stiffness import directions, spread, stretch_modulus
from taichi_soft.lab.experiments.edge_strains import read_edge, strains
from taichi_soft.lab.experiments.experiment import (
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

YOUNG = 1e6
LAWS = ("cmpm", "cmpm2", "virial")
APART = "nu = 0.25, G = E / 20"
"""A shear modulus of its own, which the laws of chapter 4 take."""

PLAIN, JUDGED = "nu = 0", "nu = 0.25"
MATERIALS = {
    PLAIN: Material(YOUNG, 0.0, 1000.0, damping_ratio=0.0),
    JUDGED: Material(YOUNG, 0.25, 1000.0, damping_ratio=0.0),
    "nu = 0.4": Material(YOUNG, 0.4, 1000.0, damping_ratio=0.0),
    APART: Material(YOUNG, 0.25, 1000.0, shear_modulus=YOUNG / 20, damping_ratio=0.0),
}
COMBINATIONS = [
    (law, name)
    for law in LAWS
    for name, material in MATERIALS.items()
    if law != "virial" or material.shear_modulus is None
]
STRETCH = 0.01

ANISOTROPIC = 0.01
"""Spread of the stiffness over all directions beyond which it is no rounding: the virial law has 1e-9."""

CORNERS = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(8)  # edges of 1 m


def tetrahedron() -> TetMesh:
    """Regular, edges of 1 m, vertex 1 on top."""
    up = CORNERS[1] / np.linalg.norm(CORNERS[1])
    side = np.cross(up, CORNERS[0] - CORNERS[2])
    side /= np.linalg.norm(side)
    frame = np.stack([np.cross(side, up), side, up])
    return TetMesh(CORNERS @ frame.T, np.array([[0, 1, 2, 3]]), fix_orientation=True)


def points(effort: Effort) -> list[Point]:
    """Each law and material, along 40 or 400 directions."""
    count = 40 if effort is Effort.QUICK else 400
    return [{"law": law, "material": name, "directions": count} for law, name in COMBINATIONS]


def measure(point: Point) -> Numbers:
    """Stiffness along every direction [Pa]; of CMPM2 also what an edge to the top reads when pulled up."""
    mesh, material, law = tetrahedron(), MATERIALS[point["material"]], point["law"]
    found: Numbers = {
        "moduli": [stretch_modulus(mesh, material, law, n) for n in directions(point["directions"])]
    }
    if law == "cmpm2":
        F = np.diag([1, 1, 1 + STRETCH])
        rest = read_edge(mesh, material, mesh.vertices, law).normal
        now = read_edge(mesh, material, mesh.vertices @ F.T, law).normal
        found["tensile"], found["shear"] = strains(F @ rest, now)
    return found


def conclude(results: Results) -> Section:
    """Spread of the stiffness of each law, and readings."""
    spreads = {
        (law, name): spread(results.one(law=law, material=name)["moduli"]) for law, name in COMBINATIONS
    }
    reading = results.one(law="cmpm2", material=JUDGED)
    least = min(spreads[law, JUDGED] for law in ("cmpm", "cmpm2"))
    agrees = least > ANISOTROPIC
    percent = {key: f"{100 * value:.2g} %" for key, value in spreads.items()}
    finding = Finding(
        "strain-misread-triangle",
        f"stiffness over all directions varies by {percent['cmpm', JUDGED]} with CMPM and "
        f"{percent['cmpm2', JUDGED]} with CMPM2 at {JUDGED}, by {percent['virial', JUDGED]} with the "
        "virial law; "
        f"at {PLAIN} by {percent['cmpm', PLAIN]} and {percent['cmpm2', PLAIN]}. An edge to the top of a "
        f"tetrahedron pulled upwards reads {reading['tensile'] / STRETCH:.2f} of the stretch as tension and "
        f"{reading['shear'] / STRETCH:.2f} as shear",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        ""
        if agrees
        else "one regular tetrahedron is as even as a mesh can be: another mesh may answer otherwise, see "
        f"the experiment anisotropy. With G = E / 20 it varies by {percent['cmpm', APART]}",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        place = np.arange(len(MATERIALS))
        for i, law in enumerate(LAWS):
            values = [100 * spreads.get((law, name), 0.0) for name in MATERIALS]
            axes.bar(place + (i - 1) * 0.25, values, 0.25, label=law)
        axes.set_xticks(place, list(MATERIALS), fontsize="small")
        axes.set_ylabel("spread of stiffness [%]")
        axes.legend()

    return Section(
        (
            "A regular tetrahedron is stretched evenly along directions all round, and the work that it "
            "takes "
            "gives its stiffness. An isotropic material has the same in all; with CMPM and its variant it "
            "depends on where the edges point.",
            "As in figure 4.5 an edge that meets the stretch at an angle (here 35 degrees) reads more shear "
            "than tension. These are the components of the strain in its frame (see fig-4.3). Anisotropy "
            "comes from weighing them with E and G alone: it is proportional to E - 2 G, which is 0 for nu = "
            "0, and largest where E and G are set apart.",
        ),
        (finding,),
        (
            Table(
                "spread",
                "Largest less smallest stiffness over all directions, over the mean",
                ("material", *(f"{law} [1]" for law in LAWS)),
                tuple(
                    (name, *(f"{spreads[law, name]:.2g}" if (law, name) in spreads else "" for law in LAWS))
                    for name in MATERIALS
                ),
            ),
        ),
        (Plot("spread", "Spread of stiffness over all directions: the virial law has none.", draw),),
    )


FIG_4_5 = Experiment(
    "fig-4.5",
    "One element stretched along many axes",
    "section 4.3, figure 4.5",
    ("strain-misread-triangle",),
    points,
    measure,
    conclude,
)
