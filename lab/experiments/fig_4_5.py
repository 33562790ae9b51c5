"""An element that is stretched along many axes (thesis figure 4.5).

The element is a tetrahedron, whereas the thesis has a triangle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.directional_stiffness import directions, spread, stretch_modulus
from lab.experiments.edge_strains import read_edge, strains
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
from lab.experiments.judgement import judged
from taichi_soft import Material, TetMesh

YOUNG = 1e6
LAWS = ("cmpm", "cmpm2", "virial")
APART = "nu = 0.25, G = E / 20"
"""Name of a material whose shear modulus is independent of E and nu. The laws of chapter 4 allow such
materials."""

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
ANISOTROPIC = 0.01
"""A law is anisotropic if the spread of the stiffness between directions exceeds this number. Rounding causes
a spread of 1e-9."""

REGULAR = float(np.degrees(np.arctan(np.sqrt(0.5))))
APEX_ANGLES = (25.0, 30.0, REGULAR, 45.0)
"""Angles between the pull and the edges at the pulled particle [degrees], for slender, regular and flat
tetrahedra. The thesis gives no angle."""

STRETCHES = (0.01, 0.3, 1.0)
"""Relative stretches of the body: two smaller stretches, and a stretch as large as in a drawing. The thesis
gives no value."""

MUCH = 2.0
"""Shear counts as much larger than tension if the shear strain is at least this multiple of the tensile
strain."""

SMALL = 0.5
"""Tension counts as small if the tensile strain is below this fraction of the stretch."""


def tetrahedron(apex_angle: float = REGULAR) -> TetMesh:
    """Make a tetrahedron on a regular base with edges of 1 m.

    Three edges meet at its top, vertex 1, at `apex_angle` [degrees] to the z axis.
    """
    turn = 2 * np.pi * np.arange(3) / 3
    base = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) / np.sqrt(3)
    height = 1 / np.sqrt(3) / np.tan(np.radians(apex_angle))
    corners = np.array([base[0], [0, 0, height], base[1], base[2]])
    return TetMesh(corners, np.array([[0, 1, 2, 3]]), fix_orientation=True)


def points(effort: Effort) -> list[Point]:
    """List the points: each law and material in 40 or 400 directions, and strains of several tetrahedra."""
    count = 40 if effort is Effort.QUICK else 400
    return [
        *({"law": law, "material": name, "directions": count} for law, name in COMBINATIONS),
        *({"apex": angle} for angle in APEX_ANGLES),
    ]


def measure(point: Point) -> Numbers:
    """Measure the stiffness in every direction [Pa], or, for a point with "apex", the strains of an edge.

    The top vertex is pulled. The strains are those that CMPM2 computes for an edge at this vertex.
    """
    if "apex" in point:
        mesh, material = tetrahedron(point["apex"]), MATERIALS[JUDGED]
        rest = read_edge(mesh, material, mesh.vertices, "cmpm2").normal
        pulls = [np.diag([1, 1, 1 + stretch]) for stretch in STRETCHES]
        normals = [read_edge(mesh, material, mesh.vertices @ F.T, "cmpm2").normal for F in pulls]
        read = [strains(F @ rest, normal) for F, normal in zip(pulls, normals, strict=True)]
        return {"tensile": [tensile for tensile, _ in read], "shear": [shear for _, shear in read]}
    mesh, material, law = tetrahedron(), MATERIALS[point["material"]], point["law"]
    return {"moduli": [stretch_modulus(mesh, material, law, n) for n in directions(point["directions"])]}


def _reading(results: Results) -> Finding:
    """Judge whether CMPM2 computes little tension and much more shear for an edge at the pulled particle."""
    told, holds = [], []
    for angle in APEX_ANGLES:
        numbers = results.one(apex=angle)
        parts = np.array([numbers["tensile"], numbers["shear"]]) / STRETCHES
        holds += ((parts[1] >= MUCH * parts[0]) & (parts[0] < SMALL)).tolist()
        told.append(f"at {angle:.0f} degrees " + ", ".join(f"{t:.2f} and {s:.2f}" for t, s in parts.T))
    stretches = ", ".join(f"{100 * stretch:g} %" for stretch in STRETCHES)
    measured = (
        f"stretched by {stretches}, edges to the pulled particle read tensile and shear strains of so many "
        f"times the stretch: {'; '.join(told)}. Shear is much larger, {MUCH:g} times or more, and "
        f"tension small, below {SMALL:g} of the stretch, in {sum(holds)} of {len(holds)}"
    )
    if all(holds) or not any(holds):
        why = "reading of the text: these are the components that the strain has in its frame (see fig-4.3)"
        return judged("strain-misread-triangle", measured, all(holds), why)
    why = (
        "the text tells neither the triangle nor how far it is stretched, and both count. What is read are "
        "the components that the strain has in the frame of the subfaces' normal (see fig-4.3): little "
        "tension and much shear where that lies at an angle to the pull"
    )
    return Finding("strain-misread-triangle", measured, Verdict.UNKNOWN, why)


def conclude(results: Results) -> Section:
    """Judge the spread of each law's stiffness, and the strains of CMPM2."""
    spreads = {
        (law, name): spread(results.one(law=law, material=name)["moduli"]) for law, name in COMBINATIONS
    }
    least = min(spreads[law, JUDGED] for law in ("cmpm", "cmpm2"))
    agrees = least > ANISOTROPIC
    percent = {key: f"{100 * value:.2g} %" for key, value in spreads.items()}
    finding = Finding(
        "cmpm-anisotropic",
        f"stiffness over all directions varies by {percent['cmpm', JUDGED]} with CMPM and "
        f"{percent['cmpm2', JUDGED]} with CMPM2 at {JUDGED}, by {percent['virial', JUDGED]} with the "
        "virial law; "
        f"at {PLAIN} by {percent['cmpm', PLAIN]} and {percent['cmpm2', PLAIN]}",
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
            "A regular tetrahedron is stretched uniformly along directions all round, and the work gives its "
            "stiffness. An isotropic material has the same stiffness in all directions. With CMPM and its "
            "variant the stiffness depends on the directions of the edges.",
            "The anisotropy comes from multiplying strains by E and G only. It is proportional to E - 2 G, "
            "which is 0 for nu = 0, and largest if E and G are chosen separately.",
            "As in figure 4.5 the particle on top is then pulled away, from slender and flat tetrahedra. The "
            "strains that CMPM2 computes for an edge there (eq. 4.9) are read from its stiffness. The thesis "
            "expects mostly tension. But an edge at an angle to the pull turns as well, and has the "
            "components of the strain in its own frame (see fig-4.3).",
        ),
        (finding, _reading(results)),
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
    ("cmpm-anisotropic", "strain-misread-triangle"),
    points,
    measure,
    conclude,
)
