"""Angles of best fitting planes and split rings to their edges (thesis section 4.4.2, figure 4.7)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.anisotropy import mesh_of
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
from lab.experiments.judgement import judged_but_for
from taichi_soft import Material, plane_angles
from taichi_soft.elements.laws.best_fitting_plane import best_fitting_plane_bonds
from taichi_soft.elements.laws.split_ring_plane import split_ring_plane_bonds
from taichi_soft.meshing import EdgeRings

BEAM = "beam with hole"
THESIS_COUNTS = {2: 140, 3: 1386, 4: 2091, 5: 1874, 6: 1820, 7: 1449, 8: 753, 9: 250, 10: 60, 11: 10, 12: 2}
"""Number of edges by the number of particles around them, in the thesis's beam with a hole (1679
particles)."""

FITTED, SPLIT = "best_fitting_plane", "split_ring_plane"
LAWS = {FITTED: "best fitting plane", SPLIT: "split ring", "cmpm2": "subfaces (CMPM2)"}
FAR, MANY = 30.0, 0.1
"""A plane is far from perpendicular if its normal and the edge form an angle above `FAR` [degrees]. Many
planes are far from perpendicular if their fraction exceeds `MANY`. The thesis has a box plot without
numbers."""
NEAR, FEW = 10.0, 0.1
"""A cheap normal is a good approximation if its angle to the fitted normal is at most `NEAR` [degrees]. At
most the fraction `FEW` of the edges may have a larger angle."""


def points(effort: Effort) -> list[Point]:
    """List the points: the beam with a hole, a ball, an even block and an uneven block."""
    size = 4 if effort is Effort.QUICK else 8
    return [{"mesh": name, "size": size} for name in (BEAM, "ball", "block", "uneven block")]


def measure(point: Point) -> Numbers:
    """Measure percentiles of two angles [degrees]: edge to normal, and fitted normal to cheap normal.

    Edges with two particles around them are omitted. The second angle also omits edges with three particles,
    because the fitted and the cheap normal of such an edge are equal.
    """
    mesh = mesh_of(point["mesh"], point["size"])
    edge, _ = EdgeRings.of(mesh).neighbours
    around = np.bincount(edge)
    sizes, counts = np.unique(around, return_counts=True)
    found: Numbers = {"edges": len(mesh.edges), "sizes": sizes.tolist(), "counts": counts.tolist()}
    material = Material(young=1.0, poisson=0.0, density=1.0)
    fitted, cheap = (
        bonds(mesh, material).normals for bonds in (best_fitting_plane_bonds, split_ring_plane_bonds)
    )
    assert fitted is not None
    assert cheap is not None
    cosine = np.abs(np.einsum("ka,ka->k", fitted, cheap))[around > 3]
    between = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
    found["between"] = [round(float(q), 3) for q in np.percentile(between, (25, 50, 75, 95))]
    found["apart"] = float((between > NEAR).mean())
    for law in LAWS:
        angles = plane_angles(mesh, law)[around > 2]
        found[law] = {
            "percentiles": [round(float(q), 3) for q in np.percentile(angles, (5, 25, 50, 75, 95))],
            "most": float(angles.max()),
            "far": float((angles > FAR).mean()),
        }
    return found


def conclude(results: Results) -> Section:
    """Judge the fraction of planes that are far from perpendicular, and the accuracy of the cheap normals.

    There are several meshes. One of them is similar to the thesis's mesh.
    """
    beam = results.one(mesh=BEAM)[FITTED]
    rows = [(point["mesh"], numbers) for point, numbers in results.where()]
    shares = ", ".join(f"{name} {100 * n[FITTED]['far']:.0f} %" for name, n in rows)
    agrees = beam["far"] > MANY
    finding = Finding(
        "best-fitting-plane-angles",
        f"in the beam with a hole half of the planes are {beam['percentiles'][2]:.0f} degrees off or more, a "
        f"quarter {beam['percentiles'][3]:.0f} degrees; beyond {FAR:.0f} degrees: {shares}; many is "
        f"called what is more than {MANY:.0%}",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        "" if agrees else "the mesh: that of the thesis is not known, and the shares above differ by mesh",
    )

    apart = {name: n["apart"] for name, n in rows}
    few = {name: share for name, share in apart.items() if share <= FEW}
    told = "; ".join(
        f"{name} {n['between'][1]:.1f}, {n['between'][2]:.1f} and {n['between'][3]:.1f} degrees, "
        f"{n['apart']:.0%} beyond {NEAR:.0f}"
        for name, n in rows
    )
    split = judged_but_for(
        "split-ring-normal",
        "angle between the cheap and the fitted normal of edges with more than three particles, below which "
        f"half, three quarters and 95 % of the edges lie: {told}. Tolerance: up to {NEAR:.0f} degrees for "
        f"all but {FEW:.0%} of the edges. Beyond {FAR:.0f} degrees from perpendicular to the edge are: "
        + ", ".join(f"{name} {n[SPLIT]['far']:.0%} (fitted {n[FITTED]['far']:.0%})" for name, n in rows),
        bool(few),
        "the ring is too uneven for its halves to span its plane",
        [name for name in apart if name not in few],
        f"more than {FEW:.0%} of the normals are more than {NEAR:.0f} degrees apart",
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for i, law in enumerate(LAWS):
            boxes = []
            for name, numbers in rows:
                low, first, middle, third, high = numbers[law]["percentiles"]
                boxes.append(
                    {"whislo": low, "q1": first, "med": middle, "q3": third, "whishi": high, "label": name}
                )
            drawn = axes.bxp(
                boxes,
                positions=np.arange(len(rows)) + (i - 1) * 0.28,
                widths=0.22,
                showfliers=False,
                patch_artist=True,
                manage_ticks=False,
                medianprops={"color": "black"},
            )
            for patch in drawn["boxes"]:
                patch.set_facecolor(f"C{i}")
            axes.plot([], [], "s", color=f"C{i}", label=LAWS[law])
        axes.set_xticks(range(len(rows)), [name for name, _ in rows])
        axes.set_ylabel("angle from perpendicular [degrees]")
        axes.legend()

    counts = dict(zip(results.one(mesh=BEAM)["sizes"], results.one(mesh=BEAM)["counts"], strict=True))
    sizes = sorted(set(counts) | set(THESIS_COUNTS))
    return Section(
        (
            "For every edge with more than two particles round it, the angle between the edge and the normal "
            "of the plane that fits these particles best. The Voronoi faces of CMPM have 0 degrees by "
            "construction. The barycentric subfaces of CMPM2 are off by about as much. The cheap normal that "
            "the section considers is the cross product of two vectors between the means of halves of the "
            "ring. It is compared with the fitted one.",
        ),
        (finding, split),
        (
            Table(
                "angles",
                "Angle from perpendicular",
                (
                    "mesh",
                    "normal",
                    "edges",
                    "5 % [deg]",
                    "25 % [deg]",
                    "50 % [deg]",
                    "75 % [deg]",
                    "95 % [deg]",
                    "largest [deg]",
                ),
                tuple(
                    (name, LAWS[law], n["edges"], *n[law]["percentiles"], round(n[law]["most"], 1))
                    for name, n in rows
                    for law in (FITTED, SPLIT)
                ),
            ),
            Table(
                "between",
                "Angle between the cheap and the fitted normal",
                (
                    "mesh",
                    "25 % [deg]",
                    "50 % [deg]",
                    "75 % [deg]",
                    "95 % [deg]",
                    f"beyond {NEAR:.0f} deg [1]",
                ),
                tuple((name, *n["between"], round(n["apart"], 3)) for name, n in rows),
            ),
            Table(
                "rings",
                "Edges of the beam with a hole by the number of particles round them",
                ("particles", "edges here", "edges in the thesis"),
                tuple((size, counts.get(size, 0), THESIS_COUNTS.get(size, 0)) for size in sizes),
            ),
        ),
        (
            Plot(
                "angles",
                "Angles from perpendicular, as in figure 4.7: boxes hold the middle half, whiskers 90 %.",
                draw,
            ),
        ),
    )


FIG_4_7 = Experiment(
    "fig-4.7",
    "Angles of best fitting planes",
    "section 4.4.2, figure 4.7",
    ("best-fitting-plane-angles", "split-ring-normal"),
    points,
    measure,
    conclude,
)
