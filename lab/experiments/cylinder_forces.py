"""Forces of a short cylinder that is stretched or sheared (thesis figure 6.4)."""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.equilibrium import Plates
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
from lab.experiments.judgement import judged
from taichi_soft import Material, TetMesh, cylinder, internal_forces

YOUNG, RADIUS, HEIGHT = 1e6, 1.0, 0.5  # values of the thesis [Pa, m]
POISSON = (0.0, 0.2, 0.4)  # the thesis plots 0.2 and mentions other values
WAYS = {"tension": (0.0, 0.0, 1.0), "shear": (1.0, 0.0, 0.0)}
COARSE, FINE = (4, 2), (6, 4)  # rings, layers: 576 tetrahedra (about as many as in the thesis) and 2592
EXACT = 0.01
"""Largest relative error of a slope that counts as exact."""
CLOSE = 0.15
"""Largest relative error of a slope that counts as close."""
NO_SHEAR = 0.01
"""A shear force counts as zero if it is at most this fraction of the tensile force."""
SHAKEN = 0.2
"""Largest random displacement of a vertex along an axis [mean edge length]."""
STRAIGHT = 0.05
"""A curve counts as straight if force / strain, divided by its theoretical value, changes by less than this
number."""


def points(effort: Effort) -> list[Point]:
    """List the points: tension and shear for each nu, a larger E, sliding ends, and an uneven mesh.

    A full report adds a finer mesh.
    """
    is_full = effort is Effort.FULL
    count = 20 if is_full else 5
    usual = {"young": YOUNG, "slide": False, "mesh": list(COARSE), "shaken": False, "count": count}
    found = [{"way": way, "poisson": nu, **usual} for way in WAYS for nu in POISSON]
    found += [{"way": way, "poisson": 0.2, **usual, "young": 3 * YOUNG} for way in WAYS]
    found += [{"way": "tension", "poisson": 0.2, **usual, "slide": True}]
    found += [{"way": "tension", "poisson": nu, **usual, "shaken": True} for nu in POISSON]
    if is_full:
        found += [{"way": way, "poisson": 0.2, **usual, "mesh": list(FINE)} for way in WAYS]
    return found


def measure(point: Point) -> Numbers:
    """Measure the forces on the top up to a strain of 0.5, or up to the last strain with an equilibrium."""
    mesh = cylinder(RADIUS, HEIGHT, *point["mesh"])
    if point["shaken"]:
        mesh = _shaken(mesh)
    plates = Plates(mesh, slide=point["slide"])
    material = Material(point["young"], point["poisson"], 1000.0, damping_ratio=0.0)
    strain = [0.01, *(0.5 * (k + 1) / point["count"] for k in range(point["count"]))]
    states = plates.path(lambda x: internal_forces(mesh, material, x), WAYS[point["way"]], strain)
    pulls = [plates.pull(internal_forces(mesh, material, x)) for x in states]
    corners = states[-1][mesh.tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    return {
        "strain": strain[: len(states)],
        "wanted": strain[-1],
        "tension": [float(pull[2]) for pull in pulls],
        "shear": [float(pull[0]) for pull in pulls],
        "aside": [float(pull[1]) for pull in pulls],
        "area": plates.area,
        "smallest": float((volumes / mesh.volumes).min()),
    }


def _shaken(mesh: TetMesh) -> TetMesh:
    """Move the inner vertices at random, to remove the symmetry that cancels shear forces."""
    x = mesh.vertices
    moves = np.random.default_rng(1).uniform(-SHAKEN, SHAKEN, x.shape) * mesh.edge_lengths.mean()
    is_inside = (np.hypot(x[:, 0], x[:, 1]) < 0.99 * RADIUS) & (np.abs(x[:, 2]) < 0.49 * HEIGHT)
    return TetMesh(x + moves * is_inside[:, None], mesh.tets)


def conclude(results: Results) -> Section:
    """Judge the slopes and the curvature of the forces, and their dependence on nu and E."""
    usual = {"young": YOUNG, "slide": False, "mesh": list(COARSE), "shaken": False}
    tension = {nu: results.one(way="tension", poisson=nu, **usual) for nu in POISSON}
    shear = {nu: results.one(way="shear", poisson=nu, **usual) for nu in POISSON}
    slid = results.one(way="tension", poisson=0.2, **{**usual, "slide": True})
    finer = results.where(way="tension", poisson=0.2, **{**usual, "mesh": list(FINE)})

    ratios = {nu: _ratio(numbers, "tension", YOUNG) for nu, numbers in tension.items()}
    slopes = {nu: _at_zero(tension[nu]["strain"], ratio) for nu, ratio in ratios.items()}
    slid_slope = _at_zero(slid["strain"], _ratio(slid, "tension", YOUNG))
    finer_slopes = [_at_zero(numbers["strain"], _ratio(numbers, "tension", YOUNG)) for _, numbers in finer]
    held = f"with nu = 0.2 {slopes[0.2]:.3f}" + "".join(f" ({x:.3f} on a finer mesh)" for x in finer_slopes)

    last = min(len(ratio) for ratio in ratios.values()) - 1
    strain = tension[0.0]["strain"][last]
    excess = {nu: (ratio[last] - 1) * strain for nu, ratio in ratios.items()}
    bends = {nu: _slope_at_zero(tension[nu]["strain"], ratio) for nu, ratio in ratios.items()}
    lost = "".join(
        f"; with nu = {nu:g} there is no state of rest beyond a strain of {numbers['strain'][-1]:g}, where "
        f"a tetrahedron has {numbers['smallest']:.2f} of its volume left"
        for nu, numbers in tension.items()
        if numbers["strain"][-1] < numbers["wanted"]
    )

    moduli = {nu: YOUNG / 2 / (1 + nu) for nu in POISSON}
    sheared = {nu: _ratio(numbers, "shear", moduli[nu]) for nu, numbers in shear.items()}
    line = np.array(sheared[0.2])
    pulled = {nu: np.array(numbers["tension"]) for nu, numbers in shear.items()}
    first, end = pulled[0.2][0], pulled[0.2][-1]
    power = np.log(end / pulled[0.2][1]) / np.log(shear[0.2]["strain"][-1] / shear[0.2]["strain"][1])
    end_shear = [shear[nu]["shear"][-1] for nu in POISSON]
    end_tension = [pulled[nu][-1] for nu in POISSON]

    tripled = max(
        float(np.abs(np.array(more[way]) / np.array(once[way]) / 3 - 1).max())
        for way, once in (("tension", tension[0.2]), ("shear", shear[0.2]))
        for more in [results.one(way=way, poisson=0.2, **{**usual, "young": 3 * YOUNG})]
    )
    stretched = results.where(way="tension", young=YOUNG, slide=False)
    sideways = {is_shaken: _sideways(stretched, is_shaken) for is_shaken in (False, True)}
    findings = (
        judged(
            "tension-slope",
            f"slope at zero over E A: {slopes[0.0]:.4f} with nu = 0, {held}; "
            f"{slid_slope:.3f} where the ends slide along the plates, free to shrink",
            abs(slopes[0.0] - 1) < EXACT and abs(slopes[0.2] - 1) < CLOSE,
            "the plates, which hold the ends, stiffen the cylinder: sliding ends have the slope above",
        ),
        judged(
            "tension-curve",
            f"with nu = 0.2 force over E A s goes from {slopes[0.2]:.3f} at zero to {ratios[0.2][-1]:.3f} at "
            f"a strain of {tension[0.2]['strain'][-1]:g}, with nu = 0 to {ratios[0.0][-1]:.3f} "
            "(linearised strain by itself: 1 + s/2)",
            all(ratios[nu][-1] > slopes[nu] + STRAIGHT for nu in (0.0, 0.2)),
            "the thesis's axes cannot be read; the linearised strain alone bends the curve upwards",
        ),
        judged(
            "tension-poisson",
            f"for nu = {_list(POISSON)}: slope over E A {_list(slopes.values())}; distance from E A s at a "
            f"strain of {strain:g}, over E A, {_list(excess.values())}; curvature at zero by itself, d(F / E "
            f"A s)/ds, {_list(bends.values())}{lost}",
            _rises(slopes.values()) and _rises(excess.values()),
            "the thesis says how much for no other nu",
        ),
        judged(
            "tension-shear",
            f"for nu = {_list(POISSON)} and strains up to {tension[0.0]['strain'][-1]:g} the shear force is "
            f"at most {sideways[False]:.1g} of the tensile force on the regular mesh, and "
            f"{sideways[True]:.1g} where the vertices inside are moved at random by up to {SHAKEN:g} of "
            f"an edge. Tolerance: {NO_SHEAR:g}",
            max(sideways.values()) < NO_SHEAR,
            "an uneven mesh is stiffer on one side than on the other",
        ),
        judged(
            "shear-slope",
            f"with nu = 0.2 force over G A s goes from {line[0]:.3f} to {line[-1]:.3f}",
            1 - CLOSE < line[0] < 1 and float(np.ptp(line)) < STRAIGHT,
            "the free sides of a cylinder take a little off its stiffness, the less the shorter it is",
        ),
        judged(
            "shear-tension",
            f"tensile force over G A: {first / moduli[0.2] / shear[0.2]['area']:.1e} at a shear of 0.01, "
            f"{end / moduli[0.2] / shear[0.2]['area']:.3f} at 0.5; it grows with the power {power:.2f} of it",
            power > 1.5 and bool((np.diff(pulled[0.2]) > 0).all()),
            "a force that grows with the square of the shear is what large strains ask for",
        ),
        judged(
            "shear-poisson",
            f"at a shear of 0.5 and nu = {_list(POISSON)}: shear force {_list(end_shear)} N, tensile "
            f"force {_list(end_tension)} N",
            _rises([-f for f in end_shear]) and _rises(end_tension),
            "G falls with nu, and with it the shear force that is expected",
        ),
        judged(
            "proportional-to-e",
            f"thrice the E gives thrice the forces, with a relative difference of {tripled:.1g}",
            tripled < 1e-6,
            "the states of rest are not the same",
        ),
    )

    def draw(way: str, curves: dict[float, Numbers], what: str) -> Any:
        def onto(figure: Any) -> None:
            axes = figure.add_subplot()
            for color, (nu, numbers) in zip(("C0", "C1", "C2"), curves.items(), strict=True):
                s = np.array([0.0, *numbers["strain"]])
                modulus = YOUNG if way == "tension" else moduli[nu]
                axes.plot(s, np.array([0.0, *numbers[way]]) / 1e6, color, label=f"{way}, nu = {nu:g}")
                expected = "E A s" if way == "tension" else f"G A s, nu = {nu:g}"
                if way == "shear":
                    label = f"tension, nu = {nu:g}"
                    axes.plot(s, np.array([0.0, *numbers["tension"]]) / 1e6, color + ":", label=label)
                if way == "shear" or nu == 0.0:
                    axes.plot(s, modulus * numbers["area"] * s / 1e6, color + "--", lw=0.8, label=expected)
            axes.set_xlabel(f"{what} [1]")
            axes.set_ylabel("force on the top [MN]")
            axes.legend(fontsize="small")

        return onto

    return Section(
        (
            "A cylinder of 0.5 m height and 2 m diameter, E = 1 MPa, with both ends attached to plates. The "
            "plates are moved apart, or sideways. The vertices between them are at rest, without a force.",
        ),
        findings,
        (
            Table(
                "forces",
                "Forces on the top",
                ("driven in", "nu [1]", "strain [1]", "tensile force [N]", "shear force [N]"),
                tuple(
                    (way, nu, *row)
                    for way, curves in (("tension", tension), ("shear", shear))
                    for nu, n in curves.items()
                    for row in zip(n["strain"], n["tension"], n["shear"], strict=True)
                ),
            ),
        ),
        (
            Plot(
                "tension",
                "Figure 6.4 (a): force of the stretched cylinder; dashed: E A s.",
                draw("tension", tension, "tensile strain"),
            ),
            Plot(
                "shear",
                "Figure 6.4 (b): force of the sheared cylinder; dashed: G A s; dotted: tensile force across.",
                draw("shear", shear, "shear strain"),
            ),
        ),
    )


def _sideways(rows: list[tuple[Point, Numbers]], is_shaken: bool) -> float:
    """Return the largest ratio of shear force to tensile force. `is_shaken` selects the meshes."""
    return max(
        float((np.hypot(n["shear"], n["aside"]) / np.abs(n["tension"])).max())
        for point, n in rows
        if point["shaken"] is is_shaken
    )


def _ratio(numbers: Numbers, way: str, modulus: float) -> list[float]:
    """Return the force divided by modulus, area and strain, for each strain."""
    forces, strain = np.array(numbers[way]), np.array(numbers["strain"])
    return list((forces / (modulus * numbers["area"] * strain)).tolist())


def _slope_at_zero(strain: list[float], ratio: list[float]) -> float:
    return (ratio[1] - ratio[0]) / (strain[1] - strain[0])


def _at_zero(strain: list[float], ratio: list[float]) -> float:
    return ratio[0] - strain[0] * _slope_at_zero(strain, ratio)


def _rises(values: Any) -> bool:
    return bool((np.diff(list(values)) > 0).all())


def _list(values: Any) -> str:
    return ", ".join(f"{float(value):.3g}" for value in values)


CYLINDER_FORCES = Experiment(
    "fig-6.4",
    "A cylinder stretched and sheared",
    "figure 6.4",
    (
        "tension-slope",
        "tension-curve",
        "tension-poisson",
        "tension-shear",
        "shear-slope",
        "shear-tension",
        "shear-poisson",
        "proportional-to-e",
    ),
    points,
    measure,
    conclude,
)
"""The experiment of figure 6.4."""
