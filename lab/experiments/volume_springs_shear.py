"""A sheared cube of springs that preserve the volume of tetrahedra (thesis figures 5.1 and 5.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.equilibrium import Plates
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
from lab.experiments.irregular import cube
from lab.experiments.judgement import Span, judged, judged_on_meshes
from taichi_soft import Material, internal_forces

YOUNG, DENSITY = 3e6, 4e3  # values of the thesis [Pa, kg/m^3]
POISSON = (0.0, 0.3)
CELLS = 4
REGULAR = "regular grid"
TOPS = 0.35, 0.75
"""Range of shears that must contain the maximum of the volume. The volume then drops beyond a shear of about
0.5."""
HALF = 0.5
"""Shear above which the volume drops in the thesis."""
FAR_BELOW = 0.7
"""A slope is far below G A if it is less than this fraction of G A."""
SLIGHT = 0.15
"""Largest relative change of a force that counts as slight."""


def points(effort: Effort) -> list[Point]:
    """List the points: both nu on a regular mesh, and on one irregular mesh or on four."""
    seeds = [None, *range(1, 5 if effort is Effort.FULL else 2)]
    steps = 40 if effort is Effort.FULL else 10
    return [{"seed": seed, "poisson": nu, "steps": steps} for seed in seeds for nu in POISSON]


def measure(point: Point) -> Numbers:
    """Measure the volume, and the forces on the top while it moves sideways by up to the cube's height."""
    mesh = cube(CELLS, point["seed"])
    plates = Plates(mesh)
    material = Material(YOUNG, point["poisson"], DENSITY, damping_ratio=0.0)
    shear = [(k + 1) / point["steps"] for k in range(point["steps"])]

    def forces(x: Any) -> Any:
        return internal_forces(mesh, material, x, law="volume_springs")

    states = plates.path(forces, (1.0, 0.0, 0.0), shear)
    pulls = [plates.pull(forces(x)) for x in states]
    corners = [x[mesh.tets] for x in states]
    return {
        "shear": shear[: len(states)],
        "volume": [float(np.linalg.det(x[:, 1:] - x[:, :1]).sum() / 6 / mesh.volume) for x in corners],
        "shear_force": [float(pull[0]) for pull in pulls],
        "tensile_force": [float(pull[2]) for pull in pulls],
        "area": plates.area,
    }


def conclude(results: Results) -> Section:
    """Judge the effect of nu = 0.3 on irregular meshes. A regular mesh shows the influence of the mesh."""
    for seed in (None, 1):
        results.one(seed=seed, poisson=0.0)
    pairs = {
        _name(point["seed"]): (numbers, results.one(seed=point["seed"], poisson=0.3))
        for point, numbers in results.where(poisson=0.0)
    }
    read = {name: _read(*pair) for name, pair in pairs.items()}
    irregular = [row for name, row in read.items() if name != REGULAR]

    spans = {key: Span([row[key] for row in irregular]) for key in irregular[0]}

    def tell(form: str) -> str:
        return f"irregular meshes: {form.format(**spans)}; {REGULAR}: {form.format(**read[REGULAR])}"

    mesh = "regular and irregular meshes differ here by more than nu = 0.3 changes"
    findings = tuple(
        _tension_finding(tell(form), list(read.values()))
        if claim == "volume-springs-tension"
        else judged_on_meshes(claim, tell(form), [row[claim] for row in irregular], why)
        for claim, form, why in (
            (
                "volume-springs-volume",
                "largest change of volume {worst_0:.2%} with nu = 0, {worst_3:.2%} with 0.3",
                "plates that hold both ends leave the volume little to change, with any nu",
            ),
            (
                "volume-springs-drop",
                "volume over that at rest, with nu = 0.3, {half_3:.4f} at a shear of 0.5, {end_3:.4f} at the "
                "end, largest at {top_3:.2f}; with nu = 0 {half_0:.4f}, {end_0:.4f}",
                mesh,
            ),
            (
                "volume-springs-shear",
                "slope over G A {slope_0:.2f} with nu = 0, {slope_3:.2f} with 0.3; force over G A at the end "
                "{last_0:.2f}, {last_3:.2f}",
                "springs along edges resist shear by where the edges point",
            ),
            (
                "volume-springs-tension",
                "tensile force over shear force at the end {tension_0:.2f} with nu = 0; with nu = 0.3 the "
                "tensile force is {less_half:+.1%} at a shear of 0.5, {less_end:+.1%} at the end",
                mesh,
            ),
            (
                "volume-springs-rise",
                "nu = 0.3 changes the slope of the shear force by {rise:+.1%} (expected -23.1 %), the force "
                "at the end by {rise_end:+.1%}",
                mesh,
            ),
        )
    )
    return Section(
        (
            "A cube of edge 1 m, E = 3 MPa. Its lower side is held and its upper side moves sideways at "
            "its height. The other vertices are at rest, without a force. The thesis used a cube of "
            "another work, of which no more is known. Here there are a regular grid, and grids whose "
            "vertices were moved at random and connected by Delaunay's rule. The thesis's meshes come from "
            "a mesher: irregular ones decide.",
        ),
        findings,
        (
            Table(
                "forces",
                "Volume and forces on the top",
                ("mesh", "nu [1]", "shear [1]", "volume [1]", "shear force [N]", "tensile force [N]"),
                tuple(
                    (name, nu, *row)
                    for name, pair in pairs.items()
                    for nu, n in zip(POISSON, pair, strict=True)
                    for row in zip(n["shear"], n["volume"], n["shear_force"], n["tensile_force"], strict=True)
                ),
            ),
        ),
        (
            Plot(
                "volume",
                "Figure 5.1: volume of the sheared cube over that at rest.",
                lambda figure: _draw(figure.add_subplot(), pairs, "volume", "volume over that at rest [1]"),
            ),
            Plot(
                "forces",
                "Figure 5.2: forces on the top; in black what Hooke's law expects, G A times the shear.",
                lambda figure: _draw_forces(figure, pairs),
                (9.0, 4.0),
            ),
        ),
    )


def _name(seed: int | None) -> str:
    return REGULAR if seed is None else f"irregular mesh {seed}"


def _tension_finding(measured: str, meshes: list[dict[str, Any]]) -> Finding:
    """Judge whether nu = 0.3 slightly lowers the tensile force on every mesh.

    The forces are compared at a shear of 0.5 and at the end.
    """
    everywhere = [row["volume-springs-tension"] for row in meshes]
    if all(everywhere) or not any(row["tension-at-the-end"] for row in meshes):
        why = "springs along edges resist a shear by the directions of the edges, whatever nu does"
        return judged("volume-springs-tension", measured, all(everywhere), why)
    at_the_end = sum(row["tension-at-the-end"] for row in meshes)
    why = (
        f"the force is a little smaller at the end on {at_the_end} of {len(meshes)} meshes, but only on "
        f"{sum(everywhere)} at a shear of {HALF:g} too. The thesis does not say where it compares, and its "
        "mesh is not known"
    )
    return Finding("volume-springs-tension", measured, Verdict.UNKNOWN, why)


def _read(without: Numbers, with_3: Numbers) -> dict[str, Any]:
    """Compare the runs of one mesh with nu = 0 and nu = 0.3.

    Returns: measured numbers by name, and for each claim True if it holds.
    """
    found: dict[str, Any] = {}
    for name, nu, n in (("0", 0.0, without), ("3", 0.3, with_3)):
        shear, volume = np.array(n["shear"]), np.array(n["volume"])
        over_ga = np.array(n["shear_force"]) / (YOUNG / 2 / (1 + nu) * n["area"])
        found |= {
            f"worst_{name}": float(np.abs(volume - 1).max()),
            f"half_{name}": float(np.interp(HALF, shear, volume)),
            f"end_{name}": float(volume[-1]),
            f"top_{name}": float(shear[volume.argmax()]),
            f"slope_{name}": float(over_ga[0] / shear[0]),
            f"last_{name}": float(over_ga[-1]),
            f"tension_{name}": n["tensile_force"][-1] / n["shear_force"][-1],
        }
    shared = min(len(without["shear"]), len(with_3["shear"]))
    half = int(np.argmin(np.abs(np.array(with_3["shear"][:shared]) - HALF)))
    changes = {
        key: np.array(with_3[key][:shared]) / np.array(without[key][:shared]) - 1
        for key in ("tensile_force", "shear_force")
    }
    found |= {
        "less_half": float(changes["tensile_force"][half]),
        "less_end": float(changes["tensile_force"][-1]),
        "rise": float(changes["shear_force"][0]),
        "rise_end": float(changes["shear_force"][-1]),
    }
    return found | {
        "volume-springs-volume": found["worst_3"] < found["worst_0"],
        "volume-springs-drop": TOPS[0] < found["top_3"] < TOPS[1] and found["end_3"] < 1.0,
        "volume-springs-shear": max(found["slope_0"], found["slope_3"]) < FAR_BELOW,
        "tension-at-the-end": found["tension_3"] > 0.1 and -SLIGHT < found["less_end"] < 0,
        "volume-springs-tension": found["tension_3"] > 0.1
        and all(-SLIGHT < found[key] < 0 for key in ("less_half", "less_end")),
        "volume-springs-rise": 0 < found["rise"] < SLIGHT,
    }


def _draw(axes: Any, pairs: dict[str, tuple[Numbers, Numbers]], key: str, label: str) -> None:
    scale = 1e6 if label.endswith("[MN]") else 1.0
    for number, (name, pair) in enumerate(pairs.items()):
        for line, nu, n in zip(("--", "-"), POISSON, pair, strict=True):
            values = [1.0 if key == "volume" else 0.0, *(value / scale for value in n[key])]
            axes.plot([0.0, *n["shear"]], values, f"C{number}{line}", label=f"{name}, nu = {nu:g}")
    axes.set_xlabel("shear [1]")
    axes.set_ylabel(label)
    axes.legend(fontsize="xx-small")


def _draw_forces(figure: Any, pairs: dict[str, tuple[Numbers, Numbers]]) -> None:
    tensile, shear = figure.subplots(1, 2)
    _draw(tensile, pairs, "tensile_force", "tensile force [MN]")
    for line, nu in zip(("--", "-"), POISSON, strict=True):
        shear.plot([0, 1], [0, YOUNG / 2 / (1 + nu) / 1e6], "k" + line, lw=0.8, label=f"G A s, nu = {nu:g}")
    _draw(shear, pairs, "shear_force", "shear force [MN]")


VOLUME_SPRINGS_SHEAR = Experiment(
    "fig-5.1-5.2",
    "A sheared cube of springs that keep volume",
    "figures 5.1 and 5.2",
    (
        "volume-springs-volume",
        "volume-springs-drop",
        "volume-springs-shear",
        "volume-springs-tension",
        "volume-springs-rise",
    ),
    points,
    measure,
    conclude,
)
"""The experiment of figures 5.1 and 5.2."""
