"""The dropped sphere for many Young's moduli and Poisson's ratios (thesis section 6.6).

Spheres of all moduli with one Poisson's ratio fall side by side in one world, without contact. The linear
limit is the modulus whose largest stable step is the thesis's step. The comparison with this limit shows how
strongly the mesh determines the upper edge.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from lab.experiments.sphere_outcomes import COLLAPSED, OUTCOMES, outcomes, window
from taichi_soft import FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, load_mesh, sphere
from taichi_soft.bodies.stability import stable_step
from taichi_soft.core.package_data import ASSETS
from taichi_soft.core.types import FlipsName
from taichi_soft.elements.laws import element_model
from taichi_soft.world.bare import bare_world

DENSITY, DAMPING, HEIGHT, VOLUME = 1000.0, 100.0, 7.0, 4.0
DT, SUBSTEPS = 1 / 50, 14  # 700 substeps per second
WINDOWS = {0.1: (2e5, 3e6), 0.4: (4e5, 1e6)}
"""Young's moduli between which the thesis's sphere is stable, by Poisson's ratio [Pa] (section 6.6)."""
LEAST, MOST = 1e5, 1e7
"""Range of moduli to try [Pa]."""
ROUNDING = 1.5
"""An edge agrees if it differs from the thesis's edge by at most this factor. The thesis prints one digit, so
1e6 can stand for 1.5e6."""
EQUAL = 1.1
"""Edges count as equal if they differ by less than this factor. Neighbouring moduli differ by a larger
factor."""
FLIPS: tuple[FlipsName, ...] = ("tolerant", "recover", "off")
MESHES = ("thesis", "coarse", "fine")
LINES = tuple(k / 20 for k in range(6, 17))
"""Alternative values of `COLLAPSED`, to show how the verdict depends on it."""


def points(effort: Effort) -> list[Point]:
    """List the points: drops with 9 moduli for each of the thesis's Poisson's ratios, and linear limits.

    A full report has 21 moduli, five ratios, all treatments of flips, and more meshes.
    """
    meshes = MESHES[:2] if effort is Effort.QUICK else MESHES
    limits: list[Point] = [
        {"part": "limit", "mesh": mesh, "poisson": nu} for mesh in meshes for nu in WINDOWS
    ]
    if effort is Effort.QUICK:
        return [_drop("thesis", nu, "tolerant", 9, 3.0) for nu in WINDOWS] + limits
    drops = [_drop("thesis", nu, flips, 21, 6.0) for flips in FLIPS for nu in (0.0, 0.1, 0.2, 0.3, 0.4)]
    return drops + [_drop(mesh, nu, "tolerant", 21, 6.0) for mesh in MESHES[1:] for nu in WINDOWS] + limits


def _drop(mesh: str, nu: float, flips: FlipsName, moduli: int, seconds: float) -> Point:
    drop = {"part": "drop", "mesh": mesh, "poisson": nu}
    return {**drop, "flips": flips, "moduli": moduli, "seconds": seconds}


def sphere_mesh(name: str) -> TetMesh:
    """Return a mesh of a sphere of 4 m^3.

    The mesh "thesis" has the number of particles of the thesis. "coarse" and "fine" are regular, with 147 and
    923 particles.
    """
    if name == "thesis":
        return load_mesh(ASSETS / "sphere.npz")
    rings = {"coarse": 3, "fine": 6}[name]
    return sphere((VOLUME / sphere(1.0, rings).volume) ** (1 / 3), rings)


def measure(point: Point) -> Numbers:
    """Measure the outcome of a sphere for each modulus, or the linear limit.

    The linear limit is the modulus for which 1/700 s is the largest stable step [Pa].
    """
    mesh, nu = sphere_mesh(point["mesh"]), point["poisson"]
    if point["part"] == "limit":
        return {"young": _linear_limit(mesh, nu), "tets": len(mesh.tets)}
    moduli = np.geomspace(LEAST, MOST, point["moduli"])
    world = bare_world(retries=0)
    bodies = [
        world.add_body(
            mesh,
            Material(E, nu, DENSITY, DAMPING, damping_ratio=0.0),
            flips=point["flips"],
            position=(4.0 * i, 0, HEIGHT),
            law="virial",
        )
        for i, E in enumerate(moduli)
    ]
    world.build()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        warnings.simplefilter("ignore", UnstableStepWarning)
        for _ in range(round(point["seconds"] / DT)):
            world.step(DT, SUBSTEPS)
    return {
        "young": [float(E) for E in moduli],
        "volume": [body.volume() / mesh.volume for body in bodies],
        "flipped": [body.flipped_count() / len(mesh.tets) for body in bodies],
        "frozen": [body.is_frozen for body in bodies],
        "extent": [float(np.ptp(body.positions(), axis=0).max()) / _extent(mesh) for body in bodies],
    }


def _extent(mesh: TetMesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max())


def _linear_limit(mesh: TetMesh, nu: float) -> float:
    """Find the modulus for which 1/700 s is the largest stable step [Pa].

    The step is about proportional to E^-1/2, so three corrections find the modulus to 1 %.
    """
    young = 1e6
    for _ in range(3):
        step = stable_step(
            mesh, Material(young, nu, DENSITY, DAMPING, damping_ratio=0.0), element_model("virial")
        )
        young *= (step.limit * SUBSTEPS / DT) ** 2
    return young


def conclude(results: Results) -> Section:
    """Compare the ranges of stable moduli with those of the thesis."""
    drops = results.where(part="drop")
    findings = [_window_finding(results, nu) for nu in WINDOWS] + [_collapse_finding(results)]
    limits = Table(
        "limits",
        "Modulus of which 1/700 s is the largest stable step at rest",
        ("mesh", "tetrahedra", "nu [1]", "E [Pa]"),
        tuple(
            (point["mesh"], numbers["tets"], point["poisson"], float(f"{numbers['young']:.3g}"))
            for point, numbers in results.where(part="limit")
        ),
    )
    columns = (
        "mesh",
        "flips",
        "nu [1]",
        "lost up to [Pa]",
        "whole from [Pa]",
        "whole to [Pa]",
        "explodes [Pa]",
    )
    windows = Table(
        "windows",
        "Edges of the windows",
        columns,
        tuple((p["mesh"], p["flips"], p["poisson"], *map(_edge, window(n))) for p, n in drops),
    )
    names = [f for f in FLIPS if results.where(part="drop", mesh="thesis", flips=f)]
    caption = (
        "What becomes of the sphere of the thesis's size. Black brackets: the windows of the thesis; "
        "dashes: the "
        "modulus of which the step is the largest stable one at rest."
    )
    recovering = results.where(part="drop", mesh="thesis", flips="recover", poisson=0.1)
    return Section(
        (
            "Spheres of 4 m^3 fall from 7 m at 700 steps a second. A sphere is dented if tetrahedra stay "
            "inverted, collapses if these leave it half of its volume or less, and explodes if it becomes "
            "non-finite. The thesis does not say whether it calls a dented sphere stable: the lower edge is "
            "a bracket from the last sphere that collapses to the first that is whole.",
            *(
                f"With recovery from flips, spheres of nu = 0.1 are whole from {window(n)[1]:.2g} "
                f"to {window(n)[2]:.2g} Pa."
                for _, n in recovering
            ),
            "With sigma = 1/(2V) sum x f^T, as printed, forces would be twice as strong and all edges half "
            "as high. Figure 6.4 contradicts that reading: its forces start with the slope E A.",
        ),
        tuple(findings),
        (windows, limits),
        (Plot("map", caption, lambda figure: _draw(figure, results, names), (4.0 + 2.6 * len(names), 4.2)),),
    )


def _edges_agree(numbers: Numbers, nu: float, collapsed: float = COLLAPSED) -> tuple[bool, bool]:
    """Return a boolean each for the lower and the upper edge: True if it agrees with the thesis's edge."""
    low, first, last, high = window(numbers, collapsed)
    thesis_low, thesis_high = WINDOWS[nu]
    return (
        low / ROUNDING <= thesis_low <= first * ROUNDING,
        last / ROUNDING <= thesis_high <= high * ROUNDING,
    )


def _is_calm(numbers: Numbers, nu: float, collapsed: float = COLLAPSED) -> bool:
    """True if no sphere between the thesis's edges collapses or explodes."""
    return all(end in ("whole", "dented") for _, end in _within(numbers, nu, collapsed))


def _window_verdict(numbers: Numbers, nu: float, collapsed: float = COLLAPSED) -> Verdict:
    """Return the verdict on the range of whole spheres.

    The verdict is "differs" if an edge is wrong, or if a sphere between the thesis's edges collapses or
    explodes. Otherwise the verdict is "agrees in part" if a sphere between the edges is dented, and "agrees"
    if no sphere is.
    """
    if not (all(_edges_agree(numbers, nu, collapsed)) and _is_calm(numbers, nu, collapsed)):
        return Verdict.DIFFERS
    is_whole = all(end == "whole" for _, end in _within(numbers, nu, collapsed))
    return Verdict.AGREES if is_whole else Verdict.PARTLY


def _within(numbers: Numbers, nu: float, collapsed: float = COLLAPSED) -> list[tuple[float, str]]:
    """List modulus [Pa] and outcome of each sphere between the thesis's edges."""
    low, high = WINDOWS[nu]
    ends = zip(numbers["young"], outcomes(numbers, collapsed), strict=True)
    return [(E, end) for E, end in ends if low <= E <= high]


def _other_lines(numbers: Numbers, nu: float) -> str:
    """Describe for which other values of `COLLAPSED` the verdict does not change."""

    def verdict(line: float) -> Verdict:
        return _window_verdict(numbers, nu, line)

    same = [line for line in LINES if verdict(line) is verdict(COLLAPSED)]
    others = [line for line in LINES if line not in same]
    told = f"; collapsed is called what keeps {COLLAPSED:g} of its volume or less: "
    if not others:
        return told + f"the verdict is the same with any line from {LINES[0]:g} to {LINES[-1]:g} instead"
    return told + (
        f"with {', '.join(f'{line:g}' for line in same)} instead the verdict is the same, with "
        f"{', '.join(f'{line:g}' for line in others)} it is '{verdict(others[0]).value}'"
    )


def _unhandled(results: Results, nu: float) -> str:
    """Describe the range of whole spheres with flips off."""
    for _, numbers in results.where(part="drop", mesh="thesis", flips="off", poisson=nu):
        _, first, last, _ = window(numbers)
        gaps = (thesis / edge for thesis, edge in zip(WINDOWS[nu], (first, last), strict=True))
        is_the_same = all(1 / EQUAL < gap < EQUAL for gap in gaps)
        return (
            f"; with flips off, so that nothing is done about them, whole from {first:.2g} to {last:.2g} Pa"
            + (", which is the thesis's very window" if is_the_same else "")
        )
    return ""


def _window_finding(results: Results, nu: float) -> Finding:
    numbers = results.one(part="drop", mesh="thesis", flips="tolerant", poisson=nu)
    low, first, last, high = window(numbers)
    thesis_low, thesis_high = WINDOWS[nu]
    lower_agrees, upper_agrees = _edges_agree(numbers, nu)
    calm = _is_calm(numbers, nu)
    inside = [end for _, end in _within(numbers, nu)]
    left = [
        f"{volume:.2f}"
        for E, end, volume in zip(numbers["young"], outcomes(numbers), numbers["volume"], strict=True)
        if thesis_low <= E <= thesis_high and end == "dented"
    ]
    measured = (
        f"whole for E from {first:.2g} to {last:.2g} Pa, collapsed at {low:.2g} Pa and below, exploded at "
        f"{high:.2g} Pa and above; within the thesis's interval {inside.count('whole')} of {len(inside)} "
        f"whole, {len(left)} dented" + (f", which keep {', '.join(left)} of their volume" if left else "")
    ) + (_other_lines(numbers, nu) + _unhandled(results, nu))
    verdict = _window_verdict(numbers, nu)
    if verdict is Verdict.AGREES:
        return Finding(f"sphere-window-{nu}", measured, verdict)
    if verdict is Verdict.PARTLY:
        dented = [E for E, end in _within(numbers, nu) if end == "dented"]
        why = (
            f"{len(dented)} of {len(inside)} spheres in the thesis's interval stay dented, from "
            f"{min(dented):.2g} to {max(dented):.2g} Pa, and the first whole one has {first:.2g} Pa. The "
            f"thesis's {thesis_low:.1g} Pa lies between collapse and whole. The thesis does not say whether "
            "it calls a dented sphere stable"
        )
        return Finding(f"sphere-window-{nu}", measured, verdict, why)
    reasons = []
    limits = {p["mesh"]: n["young"] for p, n in results.where(part="limit", poisson=nu)}
    if not upper_agrees and limits:
        spread = ", ".join(f"{young:.2g} Pa ({name})" for name, young in limits.items())
        reasons.append(
            "the upper edge is the mesh's: the modulus of which the step is the largest stable one is "
            f"{spread}, "
            f"and the thesis's mesh is not known{_from_the_other(results, nu)}{_on_others(results, nu)}; or "
            f"the reading: with 1/(2V) as printed it would be whole from {first / 2:.2g} to {last / 2:.2g} "
            f"Pa and explode at {high / 2:.2g} Pa"
        )
    if not (lower_agrees and calm):
        reasons.append(
            "the lower edge hangs on the reading: with sigma = 1/(2V) sum x f^T, as printed, forces are "
            f"twice as strong, and the edges half: {low / 2:.2g} to {first / 2:.2g} Pa"
        )
    return Finding(f"sphere-window-{nu}", measured, Verdict.DIFFERS, "; ".join(reasons))


def _from_the_other(results: Results, nu: float) -> str:
    """Describe the upper edge that follows from the thesis's upper edge for the other Poisson's ratio.

    The ratio of the two upper edges hardly depends on the mesh.
    """
    (other,) = (each for each in WINDOWS if each != nu)
    shares = [
        results.one(part="limit", mesh=p["mesh"], poisson=nu)["young"] / n["young"]
        for p, n in results.where(part="limit", poisson=other)
    ]
    expected = WINDOWS[other][1] * float(np.mean(shares))
    return f"; from its {WINDOWS[other][1]:.1g} Pa at nu = {other} about {expected:.2g} Pa would follow"


def _edge(young: float) -> float | str:
    """Format an edge for a table. Beyond the range of moduli, return "none tried"."""
    return "none tried" if young in (0.0, np.inf) else float(f"{young:.3g}")


def _on_others(results: Results, nu: float) -> str:
    """Describe the ranges of spheres of other meshes."""
    windows = [
        f"{p['mesh']} {window(n)[1]:.2g} to {window(n)[2]:.2g} Pa"
        for p, n in results.where(part="drop", flips="tolerant", poisson=nu)
        if p["mesh"] != "thesis"
    ]
    return f"; spheres of other meshes are whole from {' and '.join(windows)}" if windows else ""


def _collapse_finding(results: Results) -> Finding:
    below: list[str] = []
    above: list[str] = []
    for nu in WINDOWS:
        numbers = results.one(part="drop", mesh="thesis", flips="tolerant", poisson=nu)
        ends = outcomes(numbers)
        whole = [i for i, end in enumerate(ends) if end == "whole"]
        below += ends[: whole[0]] if whole else ends
        above += ends[whole[-1] + 1 :] if whole else []
    agrees = (
        "collapses" in below
        and set(below) <= {"collapses", "dented"}
        and bool(above)
        and set(above) == {"explodes"}
    )
    measured = (
        f"below the windows {below.count('collapses')} of {len(below)} collapse and "
        f"{below.count('dented')} are "
        f"dented; above them {above.count('explodes')} of {len(above)} explode"
    )
    why = "" if agrees else "the order of outcomes along E is another: see the map"
    return Finding("sphere-collapse", measured, Verdict.AGREES if agrees else Verdict.DIFFERS, why)


def _draw(figure: Any, results: Results, names: Sequence[str]) -> None:
    colors = {"collapses": "tab:blue", "dented": "tab:cyan", "whole": "tab:green", "explodes": "tab:red"}
    panels: NDArray[Any] = figure.subplots(1, len(names), sharey=True, squeeze=False)[0]
    for axes, flips in zip(panels, names, strict=True):
        rows = results.where(part="drop", mesh="thesis", flips=flips)
        for end in OUTCOMES:
            dots = [
                (E, p["poisson"])
                for p, n in rows
                for E, each in zip(n["young"], outcomes(n), strict=True)
                if each == end
            ]
            places = zip(*dots, strict=True) if dots else ([], [])
            axes.scatter(*places, s=90, marker="s", color=colors[end], label=end)
        for nu, (low, high) in WINDOWS.items():
            axes.plot([low, low, high, high], [nu + 0.01, nu + 0.025, nu + 0.025, nu + 0.01], color="black")
        limits = sorted((p["poisson"], n["young"]) for p, n in results.where(part="limit", mesh="thesis"))
        axes.plot([E for _, E in limits], [nu for nu, _ in limits], "--", color="gray")
        axes.set(xscale="log", xlabel="Young's modulus [Pa]", title=f"flips: {flips}")
    panels[0].set_ylabel("Poisson's ratio [1]")
    legend = panels[0].get_legend_handles_labels()
    figure.legend(*legend, loc="outside lower center", ncols=len(OUTCOMES))


STABILITY_MAP = Experiment(
    "stability-map",
    "Where the sphere is stable",
    "section 6.6",
    ("sphere-window-0.1", "sphere-window-0.4", "sphere-collapse"),
    points,
    measure,
    conclude,
)
