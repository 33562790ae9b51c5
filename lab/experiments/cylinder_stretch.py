"""Volume and width of a stretched cylinder (thesis figure 6.3 (b))."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.equilibrium import Plates
from lab.experiments.experiment import (
    Effort,
    Experiment,
    Numbers,
    Picture,
    Plot,
    Point,
    Results,
    Section,
    Table,
)
from lab.experiments.judgement import judged, judged_but_for
from taichi_soft import Material, cylinder, internal_forces

RADIUS, HEIGHT, YOUNG = 0.75, 4.0, 1e6  # values of the thesis [m, Pa]
POISSON = (0.4, 0.0, -0.4)  # for the negative value, the thesis gives only the sign
COARSE, FINE = (2, 10), (3, 16)  # rings and layers: 720 tetrahedra (492 in the thesis), and 2592
FURTHEST, MODERATE = 0.5, 0.25
KEPT = 0.05
"""The volume counts as preserved if its relative change is at most this number."""


def points(effort: Effort) -> list[Point]:
    """List the points: each nu with the linearised strain, and nu = 0.4 with the exact strain.

    A full report adds each nu on a finer mesh.
    """
    is_full = effort is Effort.FULL
    usual = {"strain": "linear", "mesh": list(COARSE), "steps": 20 if is_full else 4}
    found = [{"poisson": nu, **usual} for nu in POISSON]
    found.append({"poisson": 0.4, **usual, "strain": "exact"})
    return found + [{"poisson": nu, **usual, "mesh": list(FINE)} for nu in POISSON if is_full]


def measure(point: Point) -> Numbers:
    """Measure the volume and the width at mid-height for each stretch, relative to their values at rest.

    The shape at the last stretch is stored, too.
    """
    mesh = cylinder(RADIUS, HEIGHT, *point["mesh"])
    plates, material = Plates(mesh), Material(YOUNG, point["poisson"], 1000.0, damping_ratio=0.0)
    stretch = [FURTHEST * (k + 1) / point["steps"] for k in range(point["steps"])]
    states = plates.path(
        lambda x: internal_forces(mesh, material, x, strain=point["strain"]), (0.0, 0.0, 1.0), stretch
    )
    corners = [x[mesh.tets] for x in states]
    rest = mesh.vertices
    rim = (np.abs(rest[:, 2]) < 1e-9) & (np.hypot(*rest[:, :2].T) > RADIUS * (1 - 1e-9))
    return {
        "stretch": stretch[: len(states)],
        "volume": [float(np.linalg.det(x[:, 1:] - x[:, :1]).sum() / 6 / mesh.volume) for x in corners],
        "width": [float(np.hypot(*x[rim, :2].T).mean() / RADIUS) for x in states],
        "shape": np.round(states[-1], 4).tolist(),
    }


def conclude(results: Results) -> Section:
    """Judge the volume and the width for each nu."""
    usual = {"strain": "linear", "mesh": list(COARSE)}
    curves = {nu: results.one(poisson=nu, **usual) for nu in POISSON}
    exact = results.one(poisson=0.4, strain="exact", mesh=list(COARSE))
    kept, lost, wide = (curves[nu] for nu in POISSON)
    slim = "the strain of eq. 6.7 makes the cylinder too slim; the exact strain keeps more of the volume"

    def tell(key: str, numbers: Numbers, nu: float) -> str:
        finer = results.where(poisson=nu, strain="linear", mesh=list(FINE))
        return (
            f"{_at(numbers, key, MODERATE):.3f} at a stretch of {MODERATE:.0%} and {numbers[key][-1]:.3f} at "
            f"{numbers['stretch'][-1]:.0%}"
            + (", beyond which no state of rest is found" if numbers["stretch"][-1] < FURTHEST else "")
            + "".join(f" (on a finer mesh {n[key][-1]:.3f} at {n['stretch'][-1]:.0%})" for _, n in finer)
        )

    def draw(figure: Any) -> None:
        for axes, key in zip(figure.subplots(1, 2), ("volume", "width"), strict=True):
            for nu, n in curves.items():
                axes.plot([0.0, *n["stretch"]], [1.0, *n[key]], label=f"nu = {nu:g}")
            axes.plot([0.0, *exact["stretch"]], [1.0, *exact[key]], "C0--", label="nu = 0.4, exact strain")
            axes.set_xlabel("stretch [1]")
            axes.set_ylabel(f"{key} over that at rest [1]")
            axes.legend(fontsize="small")

    return Section(
        (
            "A cylinder of 4 m and 1.5 m diameter, E = 1 MPa, with its ends attached to plates that are "
            "moved apart. Without plates, Hooke's law with the linearised strain gives the width sqrt(1 - "
            "nu (2 s + s^2)) at a stretch s: with nu = 0.4 the volume first grows a little and then falls.",
        ),
        (
            judged_but_for(
                "cylinder-0.4",
                f"volume over that at rest {tell('volume', kept, 0.4)}; with the exact strain "
                f"{_at(exact, 'volume', MODERATE):.3f} and {exact['volume'][-1]:.3f}. Tolerance: a volume "
                f"that changes by less than {KEPT:.0%} counts as kept",
                abs(_at(kept, "volume", MODERATE) - 1) < KEPT,
                slim,
                [] if abs(kept["volume"][-1] - 1) < KEPT else [f"a stretch of {kept['stretch'][-1]:.0%}"],
                slim,
            ),
            judged(
                "cylinder-0",
                f"volume over that at rest {tell('volume', lost, 0.0)}",
                _at(lost, "volume", MODERATE) - 1 > 0.8 * MODERATE,
                "without a nu there is nothing to make the cylinder slimmer: see the width",
            ),
            judged(
                "cylinder-negative",
                f"with nu = -0.4 width over that at rest {tell('width', wide, -0.4)}",
                _at(wide, "width", MODERATE) > 1.01 and bool((np.diff(wide["width"]) > 0).all()),
                "the thesis does not tell its nu",
            ),
        ),
        (
            Table(
                "shapes",
                "Volume and width half way up",
                ("nu [1]", "stretch [1]", "volume [1]", "width [1]"),
                tuple(
                    (nu, *row)
                    for nu, n in curves.items()
                    for row in zip(n["stretch"], n["volume"], n["width"], strict=True)
                ),
            ),
        ),
        (Plot("shapes", "Volume and width over those at rest.", draw, (9.0, 3.5)),),
        (_picture(list(curves.values())),),
    )


def _at(numbers: Numbers, key: str, stretch: float) -> float:
    return float(np.interp(stretch, [0.0, *numbers["stretch"]], [1.0, *numbers[key]]))


def _picture(curves: list[Numbers]) -> Picture:
    from lab.experiments.pictures import picture

    mesh = cylinder(RADIUS, HEIGHT, *COARSE)
    shapes = [mesh.vertices, *(np.array(numbers["shape"]) for numbers in curves)]
    standing = [x - (0.0, 0.0, x[:, 2].min()) + (2.2 * place, 0.0, 0.0) for place, x in enumerate(shapes)]
    caption = "Figure 6.3 (b): from left to right at rest, and stretched with nu = " + ", ".join(
        f"{nu:g} by {numbers['stretch'][-1]:.0%}" for nu, numbers in zip(POISSON, curves, strict=True)
    )
    return Picture("shapes", caption + ".", picture([(mesh, x) for x in standing], floor=True))


CYLINDER_STRETCH = Experiment(
    "fig-6.3b",
    "A stretched cylinder",
    "figure 6.3 (b)",
    ("cylinder-0.4", "cylinder-0", "cylinder-negative"),
    points,
    measure,
    conclude,
)
"""The experiment of figure 6.3 (b)."""
