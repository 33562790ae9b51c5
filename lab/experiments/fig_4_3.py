"""Strain of an edge in a body that is stretched at an angle to the edge (thesis section 4.3, figure 4.3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.edge_strains import read_edge, ringed_edge, strains
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
from taichi_soft import Material, TetMesh

YOUNG = 1e6
POISSONS = (0.0, 0.25)
STRETCHES = (0.01, 0.3)
"""Relative stretches: a small stretch for the comparison with the strain tensor, and a large stretch like
that drawn in figure 4.3."""

THESIS_ANGLE = 30
"""Angle of figure 4.3 (b) [degrees]."""

WRONG = 0.1
"""A strain counts as wrong if its error exceeds this fraction of the stretch."""


def points(effort: Effort) -> list[Point]:
    """List the points: angles between edge and stretch [degrees], for each Poisson's ratio."""
    step = 30 if effort is Effort.QUICK else 5
    return [{"angle": angle, "poisson": nu} for nu in POISSONS for angle in range(0, 91, step)]


def measure(point: Point) -> Numbers:
    """Measure the strains that CMPM computes for an edge, and the stress on the edge's face.

    Returns: "tensile" and "shear", strains of the edge in a body stretched along z by each of `STRETCHES`;
        "stress", components along and across the normal of the face [Pa], in a bar that is stretched by the
        first of `STRETCHES` and contracts laterally.
    """
    turn = np.radians(point["angle"])
    rotation = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    upright = ringed_edge(4)
    mesh = TetMesh(upright.vertices @ rotation.T, upright.tets)
    material = Material(YOUNG, point["poisson"], 1000.0, damping_ratio=0.0)
    r = mesh.vertices[1] - mesh.vertices[0]  # length 1 m
    found: Numbers = {"tensile": [], "shear": []}
    for stretch in STRETCHES:
        F = np.diag([1, 1, 1 + stretch])
        reading = read_edge(mesh, material, mesh.vertices @ F.T, "cmpm")
        tensile, shear = strains(F @ r, reading.normal)
        found["tensile"].append(tensile)
        found["shear"].append(shear)
    area = read_edge(mesh, material, mesh.vertices, "cmpm").tension_stiffness / YOUNG
    s = STRETCHES[0]
    F = np.diag([1 - point["poisson"] * s, 1 - point["poisson"] * s, 1 + s])
    reading = read_edge(mesh, material, mesh.vertices @ F.T, "cmpm")
    tensile, shear = strains(F @ r, reading.normal)
    found["stress"] = [reading.tension_stiffness * tensile / area, reading.shear_stiffness * shear / area]
    return found


def components(angle: float, stretch: float) -> tuple[float, float]:
    """Return two components of the strain tensor of a small stretch.

    The first is the tensile strain along the edge, the second is the shear angle.
    """
    turn = np.radians(angle)
    return float(stretch * np.cos(turn) ** 2), float(stretch * np.sin(2 * turn))


def traction(angle: float, stretch: float) -> tuple[float, float]:
    """Return the stress on the edge's face in a bar in tension by Hooke's law [Pa].

    The two components are along and across the normal of the face.
    """
    turn = np.radians(angle)
    pull = float(YOUNG * stretch * np.cos(turn))
    return pull * float(np.cos(turn)), pull * float(np.sin(turn))


def conclude(results: Results) -> Section:
    """Compare the strains with the strain tensor, and the stresses with Hooke's law."""
    s = STRETCHES[0]
    angles = sorted({int(point["angle"]) for point, _ in results.where(poisson=POISSONS[1])})
    at = {nu: {angle: results.one(angle=angle, poisson=nu) for angle in angles} for nu in POISSONS}
    rows, off, off_stress = [], 0.0, {nu: 0.0 for nu in POISSONS}
    for angle in angles:
        numbers = at[POISSONS[1]][angle]
        right, hooke = components(angle, s), traction(angle, s)
        off = max(off, abs(numbers["tensile"][0] - right[0]) / s, abs(numbers["shear"][0] - right[1]) / s)
        for nu in POISSONS:
            gaps = [abs(a - b) / (YOUNG * s) for a, b in zip(at[nu][angle]["stress"], hooke, strict=True)]
            off_stress[nu] = max(off_stress[nu], *gaps)
        rows.append(
            (
                angle,
                *(
                    f"{value / s:.3f}"
                    for value in (numbers["tensile"][0], right[0], numbers["shear"][0], right[1])
                ),
                *(f"{at[nu][angle]['stress'][0] / (YOUNG * s):.3f}" for nu in POISSONS),
                f"{hooke[0] / (YOUNG * s):.3f}",
            )
        )
    there = at[POISSONS[1]][THESIS_ANGLE]
    is_wrong = off > WRONG
    finding = Finding(
        "strain-misread-edge",
        f"stretched by {s} at {THESIS_ANGLE} degrees it reads a tensile strain of "
        f"{there['tensile'][0] / s:.3f} "
        f"and a shear strain of {there['shear'][0] / s:.3f} times the stretch, where the components of "
        "strain "
        f"in the frame of the edge are {components(THESIS_ANGLE, 1)[0]:.3f} and "
        f"{components(THESIS_ANGLE, 1)[1]:.3f}; over all angles they differ by {off:.2g} at most",
        Verdict.AGREES if is_wrong else Verdict.DIFFERS,
        ""
        if is_wrong
        else "reading of the text: a mix of both does turn up as drawn, but it is what the strain has there. "
        "Wrong is the stress made of it: without the strain across the edge, the stress of the face of a bar "
        f"in tension is off by {100 * off_stress[POISSONS[1]]:.2g} % of E s for nu = {POISSONS[1]}, by "
        f"{100 * off_stress[POISSONS[0]]:.1g} % for nu = {POISSONS[0]}",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        dense = np.arange(91)
        exact = np.array([components(float(angle), 1) for angle in dense])
        axes.plot(dense, exact[:, 0], "-", color="C0", linewidth=1, label="tensile, strain tensor")
        axes.plot(dense, exact[:, 1], "-", color="C1", linewidth=1, label="shear, strain tensor")
        for i, (stretch, mark) in enumerate(zip(STRETCHES, "o^", strict=True)):
            for color, key in (("C0", "tensile"), ("C1", "shear")):
                values = [at[POISSONS[1]][angle][key][i] / stretch for angle in angles]
                axes.plot(angles, values, mark, color=color, label=f"{key}, stretched by {stretch}")
        axes.axvline(THESIS_ANGLE, color="grey", linestyle=":", label="figure 4.3 (b)")
        axes.set_xlabel("angle between edge and stretch [degrees]")
        axes.set_ylabel("strain of the edge, over the stretch [1]")
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize="small")

    def draw_stress(figure: Any) -> None:
        axes = figure.add_subplot()
        dense = np.arange(91)
        axes.plot(dense, np.cos(np.radians(dense)) ** 2, "k-", linewidth=1, label="Hooke's law")
        for nu, mark in zip(POISSONS, "o^", strict=True):
            values = [at[nu][angle]["stress"][0] / (YOUNG * s) for angle in angles]
            axes.plot(angles, values, mark, label=f"CMPM, nu = {nu}")
        axes.set_xlabel("angle between edge and bar [degrees]")
        axes.set_ylabel("stress along the edge, over E s [1]")
        axes.legend()

    return Section(
        (
            "An edge in a ring of four vertices is turned relative to the stretch of its body. The strain "
            "that CMPM computes for it is read from its stiffness. The thesis expects only tension, equal "
            "to the stretch. But an edge at an angle is stretched and sheared, and CMPM computes both "
            "components of the strain tensor correctly.",
            "The stress is another matter. Hooke's law includes the strains across the edge, and E times the "
            "strain along it does not. In a bar in tension a face at an angle therefore carries too little, "
            "and one along the bar is compressed by nu E s, where there should be no stress. With nu = 0 and "
            "G = E / 2 the stresses are right at every angle.",
        ),
        (finding,),
        (
            Table(
                "strains",
                f"Over the stretch of {s}; stress along the edge in a bar in tension, over E s",
                (
                    "angle [degrees]",
                    "tensile [1]",
                    "strain tensor [1]",
                    "shear [1]",
                    "strain tensor [1]",
                    *(f"stress, nu = {nu} [1]" for nu in POISSONS),
                    "stress, Hooke [1]",
                ),
                tuple(rows),
            ),
        ),
        (
            Plot("strains", "Strain that CMPM reads, and components of the strain tensor.", draw, (8.5, 4.0)),
            Plot("stress", "Stress along the edge in a bar in tension: wrong unless nu = 0.", draw_stress),
        ),
    )


FIG_4_3 = Experiment(
    "fig-4.3",
    "The strain of one edge",
    "section 4.3, figure 4.3",
    ("strain-misread-edge",),
    points,
    measure,
    conclude,
)
