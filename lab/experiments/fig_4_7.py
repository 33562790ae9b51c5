"""How far best fitting planes are from perpendicular to their edges (thesis section 4.4.2, figure 4.7)."""

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
from taichi_soft import plane_angles
from taichi_soft.meshing import EdgeRings

BEAM = "beam with hole"
THESIS_COUNTS = {2: 140, 3: 1386, 4: 2091, 5: 1874, 6: 1820, 7: 1449, 8: 753, 9: 250, 10: 60, 11: 10, 12: 2}
"""Edges by the number of particles round them, of the thesis's beam with a hole (1679 particles)."""

LAWS = {"best_fitting_plane": "best fitting plane", "cmpm2": "subfaces (CMPM2)"}
FAR, MANY = 30.0, 0.1
"""What is called far from perpendicular [degrees], and which part of the edges many. The thesis has a box
plot without figures."""


def points(effort: Effort) -> list[Point]:
    """The beam with a hole, a ball, and blocks that are even and uneven."""
    size = 4 if effort is Effort.QUICK else 8
    return [{"mesh": name, "size": size} for name in (BEAM, "ball", "block", "uneven block")]


def measure(point: Point) -> Numbers:
    """Angles between edges and normals [degrees] in percentiles, without edges of two particles."""
    mesh = mesh_of(point["mesh"], point["size"])
    edge, _ = EdgeRings.of(mesh).neighbours
    around = np.bincount(edge)
    sizes, counts = np.unique(around, return_counts=True)
    found: Numbers = {"edges": len(mesh.edges), "sizes": sizes.tolist(), "counts": counts.tolist()}
    for law in LAWS:
        angles = plane_angles(mesh, law)[around > 2]
        found[law] = {
            "percentiles": [round(float(q), 3) for q in np.percentile(angles, (5, 25, 50, 75, 95))],
            "most": float(angles.max()),
            "far": float((angles > FAR).mean()),
        }
    return found


def conclude(results: Results) -> Section:
    """Share of planes that are far off, on the mesh like the thesis's and on others."""
    beam = results.one(mesh=BEAM)["best_fitting_plane"]
    rows = [(point["mesh"], numbers) for point, numbers in results.where()]
    shares = ", ".join(f"{name} {100 * n['best_fitting_plane']['far']:.0f} %" for name, n in rows)
    agrees = beam["far"] > MANY
    finding = Finding(
        "best-fitting-plane-angles",
        f"in the beam with a hole half of the planes are {beam['percentiles'][2]:.0f} degrees off or more, a "
        f"quarter {beam['percentiles'][3]:.0f} degrees; beyond {FAR:.0f} degrees: {shares}; many is "
        f"called what is more than {MANY:.0%}",
        Verdict.AGREES if agrees else Verdict.DIFFERS,
        "" if agrees else "the mesh: that of the thesis is not known, and the shares above differ by mesh",
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
                positions=np.arange(len(rows)) + (i - 0.5) * 0.4,
                widths=0.3,
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
            "construction. The barycentric subfaces of CMPM2 are off by about as much.",
        ),
        (finding,),
        (
            Table(
                "angles",
                "Angle from perpendicular, best fitting plane",
                (
                    "mesh",
                    "edges",
                    "5 % [deg]",
                    "25 % [deg]",
                    "50 % [deg]",
                    "75 % [deg]",
                    "95 % [deg]",
                    "largest [deg]",
                ),
                tuple(
                    (
                        name,
                        n["edges"],
                        *n["best_fitting_plane"]["percentiles"],
                        round(n["best_fitting_plane"]["most"], 1),
                    )
                    for name, n in rows
                ),
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
    ("best-fitting-plane-angles",),
    points,
    measure,
    conclude,
)
