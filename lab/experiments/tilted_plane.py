"""The tilted plane under shear (thesis section 4.4.3). The thesis did not implement it."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.edge_strains import edge_in_ring, read_edge, ringed_edge
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
from lab.experiments.judgement import Span
from taichi_soft import Material, TetMesh

MATERIAL = Material(1e6, 0.25, 1000.0, damping_ratio=0.0)
LAWS = {"tilted_plane_printed": "as printed", "tilted_plane": "c = beta / pi"}
ANGLES = (0.01, 0.05, 0.1, 0.2, 0.4)
"""Shear angles [rad]."""

SMALL = ANGLES[0]
FOLLOWS = 0.05
"""A plane follows the shear if the relative error of its rotation is below this number."""

UNEVEN = ((0.0, 40.0, 130.0, 170.0, 260.0), (0.0, 110.0, 150.0, 240.0, 265.0, 330.0))
"""Angles of the particles in two uneven rings [degrees]."""


def points(effort: Effort) -> list[Point]:
    """List the points: both readings of eq. 4.12, on even rings of 3 to 12 particles and two uneven rings."""
    sizes = (4, 6, 7) if effort is Effort.QUICK else (3, 4, 5, 6, 7, 8, 10, 12)
    rings = [f"{size} even" for size in sizes] + [f"{len(ring)} uneven" for ring in UNEVEN]
    return [{"law": law, "ring": ring} for law in LAWS for ring in rings]


def mesh_of(ring: str) -> TetMesh:
    """Make an edge in a ring of particles, by the name of the ring, such as "6 even"."""
    count, kind = ring.split()
    if kind == "even":
        return ringed_edge(int(count))
    (turns,) = (np.radians(turns) for turns in UNEVEN if len(turns) == int(count))
    return edge_in_ring(np.stack([np.cos(turns), np.sin(turns), 0 * turns], axis=1))


def measure(point: Point) -> Numbers:
    """Measure the rotation of the plane for each of `ANGLES` [rad].

    Returns: "tilt", rotation about the axis of the shear; "aside", rotation across this axis. In a shear
        along the edge, lines across the edge rotate by the shear angle, and the edge keeps its direction.
    """
    mesh = mesh_of(point["ring"])
    found = []
    for angle in ANGLES:
        x = mesh.vertices.copy()
        x[:, 2] += np.tan(angle) * x[:, 0]
        n = read_edge(mesh, MATERIAL, x, point["law"]).normal
        found.append((float(np.arctan2(-n[0], n[2])), float(np.arctan2(n[1], n[2]))))
    return {"tilt": [along for along, _ in found], "aside": [across for _, across in found]}


def conclude(results: Results) -> Section:
    """Judge what fraction of a small shear the planes follow."""
    rings = [point["ring"] for point, _ in results.where(law="tilted_plane")]
    share = {
        (law, ring): results.one(law=law, ring=ring)["tilt"][0] / SMALL for law in LAWS for ring in rings
    }
    aside = {ring: abs(results.one(law="tilted_plane", ring=ring)["aside"][0]) / SMALL for ring in rings}
    even, uneven = ([ring for ring in rings if ring.endswith(f" {kind}")] for kind in ("even", "uneven"))
    printed, right = ([share[law, ring] for ring in even] for law in LAWS)
    agrees = all(abs(value - 1) < FOLLOWS for value in printed)
    missed = max(abs(share["tilted_plane", ring] - 1) for ring in uneven)
    finding = Finding(
        "tilted-plane",
        f"on even rings the plane of eq. 4.12 as printed tilts by {Span(printed):.3f} of a small shear; with "
        f"c = beta / pi by {Span(right):.3f}",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        ""
        if agrees
        else "reading of the text: eq. 4.11 sums what every particle adds, but leaves out that each tilts it "
        "about an axis of its own, of which only a part lies along the shear's: sin^2 t stands there, not "
        "abs(sin t), and the integral is pi; and eq. 4.12 divides by 2 pi once more. c = beta / pi follows "
        f"from the first and is measured to be off by {max(abs(value - 1) for value in right):.1g} on even "
        f"rings, by up to {missed:.2f} on uneven ones, with up to {max(aside[ring] for ring in uneven):.2f} "
        "to the side: the doubt of section 4.4.3 about rings at random is well founded",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        axes.plot(ANGLES, ANGLES, "k:", label="the whole shear")
        axes.plot(ANGLES, np.array(ANGLES) / 8, "k--", linewidth=1, label="an eighth of it")
        for law, label in LAWS.items():
            for ring in (even[0], *uneven):
                mark = ("o" if ring in even else "x") + "-"
                tilt = results.one(law=law, ring=ring)["tilt"]
                axes.plot(ANGLES, tilt, mark, linewidth=0.8, label=f"{label}, ring of {ring}")
        axes.set_xlabel("shear [rad]")
        axes.set_ylabel("tilt of the plane [rad]")
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize="small")

    return Section(
        (
            "An edge in a ring of particles is sheared. The direction of tension is read from the "
            "stiffness of the edge. A plane that follows the shear turns by the same angle.",
        ),
        (finding,),
        (
            Table(
                "tilts",
                f"Tilt over a shear of {SMALL} rad",
                ("particles", *(f"{label} [1]" for label in LAWS.values()), "to the side, c = beta / pi [1]"),
                tuple(
                    (ring, *(round(share[law, ring], 4) for law in LAWS), round(aside[ring], 4))
                    for ring in rings
                ),
            ),
        ),
        (Plot("tilt", "Tilt of the plane against the shear.", draw, (8.5, 4.0)),),
    )


TILTED_PLANE = Experiment(
    "tilted-plane",
    "The tilted plane, built",
    "section 4.4.3",
    ("tilted-plane",),
    points,
    measure,
    conclude,
)
