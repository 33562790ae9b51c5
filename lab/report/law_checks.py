"""Table of all laws and checks against theory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lab.experiments import Results, Table
from lab.experiments.bar_stiffness import LINEAR
from lab.experiments.beams import LOADS
from lab.experiments.directional_stiffness import spread
from lab.experiments.dynamics.natural_frequencies import COARSE, ELEMENTS
from lab.experiments.dynamics.pressed_sphere import DEPTHS, RADIUS, hertz_force
from lab.experiments.dynamics.swinging_beam import theory
from lab.experiments.dynamics.wave_speed import POISSONS, SPEED
from lab.report.judgements import Concluded
from taichi_soft import LAWS
from taichi_soft.core.types import LawName

Values = Mapping[str, float]
"""Numbers by law."""

THEORY = "theory"
DEPTH = 1
"""Index in `DEPTHS` of a depth that is small enough for Hertz's theory, and large enough for the mesh."""


def law_table(sections: Sequence[Concluded]) -> Table | None:
    """Return a table with a row for each law and a column for each check; None if no check was made."""
    results = {experiment.name: results for experiment, results, _ in sections}
    checks: dict[str, tuple[float, Values]] = {}
    if "patch-test" in results:
        checks["patch test: error of forces [1]"] = 0.0, _patch(results["patch-test"])
    if "beams" in results:
        checks |= {
            f"{load}: stiffness over theory [1]": (1.0, _beam(results["beams"], load)) for load in LOADS
        }
    if "natural-frequencies" in results:
        checks["first frequency over theory [1]"] = 1.0, _frequency(results["natural-frequencies"])
    if "wave-speed" in results:
        checks["wave speed over theory [1]"] = 1.0, _speed(results["wave-speed"])
    if "hertz" in results:
        checks["force on a plane over Hertz's [1]"] = 1.0, _pressed(results["hertz"])
    if "momentum-budget" in results:
        checks["change of angular momentum [1]"] = 0.0, _turning(results["momentum-budget"])
    if "anisotropy" in results:
        checks["spread of stiffness over directions [1]"] = 0.0, _spread(results["anisotropy"])
    if not checks:
        return None
    rows = [(THEORY, *(right for right, _ in checks.values()))]
    rows += [
        (law, *(_rounded(values.get(law)) for _, values in checks.values()))
        for law in (LINEAR, *LAWS)
        if any(law in values for _, values in checks.values())
    ]
    return Table("laws", "Every law against theory", ("law", *checks), tuple(rows))


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.2g}" if abs(value) < 0.1 else f"{value:.3f}")


def _patch(results: Results) -> Values:
    found: dict[str, float] = {}
    for point, numbers in results.where():
        found[point["law"]] = max(found.get(point["law"], 0.0), numbers["surface"][0])
    return found


def _beam(results: Results, load: str) -> Values:
    cells = min((point["cells"] for point, _ in results.where(law="virial")), default=0)
    rows = results.where(cells=cells)
    return {point["law"]: numbers[load] for point, numbers in rows if point["strain"] in (None, "linear")}


def _frequency(results: Results) -> Values:
    rows = results.where(cells=COARSE)
    return {_name(point["law"]): n["cantilever"] / theory("cantilever") for point, n in rows}


def _speed(results: Results) -> Values:
    rows = results.where(poisson=POISSONS[0], cells=2)
    return {point["law"]: numbers["speed"] / SPEED for point, numbers in rows}


def _pressed(results: Results) -> Values:
    force = hertz_force(DEPTHS[DEPTH] * RADIUS)
    found: dict[str, float] = {}
    for point, numbers in results.where(plane="floor"):
        found.setdefault(_name(point["law"]), numbers["forces"][DEPTH] / force)
    return found


def _turning(results: Results) -> Values:
    rows = results.where(damping=0.0)
    return {point["law"]: n["angular_momentum"] for point, n in rows if n["angular_momentum"] >= 0}


def _spread(results: Results) -> Values:
    return {point["law"]: spread(numbers["around"]) for point, numbers in results.where(mesh="block")}


def _name(law: LawName) -> str:
    return LINEAR if law == ELEMENTS else law
