"""Kinetic energy accumulates without damping, and little damping prevents this (thesis section 6.4).

The thesis's stress is not the derivative of an energy, except for the virial law at nu = 1/4, with W = 1/2
lambda (J (tr b - 5) + 2) and b = F F^T. In this case, and under any law with an energy, kinetic energy must
not accumulate.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

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
from taichi_soft import Body, FrozenBodyWarning, Material, box
from taichi_soft.world.bare import bare_world

YOUNG, DENSITY, EDGE = 1e5, 1000.0, 1.0
STRETCH, TWIST = 1.15, 0.4  # initial stretch, and initial twist [rad/m]
DT = 1 / 60
READ_EVERY = 3  # steps between two measurements
CONSERVATIVE = 0.25  # Poisson's ratio at which the linear virial stress has an energy
LITTLE = 0.05
"""Largest damping that counts as very little, as a fraction of the critical damping. The longest vibration of
the cube determines the critical damping."""
GROWS, STAYS = 1.15, 1.05
"""Limits of the ratio that `growth` returns. The energy grows if the ratio exceeds `GROWS`, and is constant
if the ratio is below `STAYS`."""


def points(effort: Effort) -> list[Point]:
    """List the points: the virial law with little or no damping, and a law with an energy, undamped.

    The Poisson's ratios are those of the thesis, and 1/4.
    """
    seconds = 20.0 if effort is Effort.QUICK else 60.0
    cases = [("virial", nu, b, 6) for nu in (0.1, 0.25, 0.4) for b in (0.0, 10.0)]
    cases.append(("st_venant_kirchhoff", 0.1, 0.0, 6))
    if effort is Effort.FULL:
        cases += [("virial", nu, 0.0, 6) for nu in (0.0, 0.2, 0.3)]
        cases += [("virial", nu, b, 6) for nu in (0.1, 0.25, 0.4) for b in (1.0, 3.0)]
        cases += [("virial", nu, 0.0, 24) for nu in (0.1, 0.4)]
        cases += [("st_venant_kirchhoff", 0.4, 0.0, 6)]
    names = ("law", "poisson", "damping", "substeps")
    return [{**dict(zip(names, case, strict=True)), "seconds": seconds} for case in cases]


def measure(point: Point) -> Numbers:
    """Measure the energies over time of a cube that is released stretched and twisted, without gravity."""
    mesh = box((EDGE, EDGE, EDGE), (3, 3, 3))
    world = bare_world(gravity=(0, 0, 0), retries=0)
    material = Material(YOUNG, point["poisson"], DENSITY, point["damping"], damping_ratio=0.0)
    body = world.add_body(mesh, material, law=point["law"], position=(0, 0, 10.0))
    world.build()
    x = (mesh.vertices - mesh.vertices.mean(axis=0)) * (STRETCH, 1.0, 1.0)
    cos, sin = np.cos(TWIST * x[:, 2]), np.sin(TWIST * x[:, 2])
    twisted = np.column_stack([x[:, 0] * cos - x[:, 1] * sin, x[:, 0] * sin + x[:, 1] * cos, x[:, 2] + 10.0])
    body.set_motion(twisted, np.zeros_like(twisted))
    has_energy = point["law"] != "virial" or point["poisson"] == CONSERVATIVE
    time, kinetic, total = [], [], []
    for step in range(round(point["seconds"] / DT)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FrozenBodyWarning)
            world.step(DT, point["substeps"])
        if body.is_frozen:
            break
        if step % READ_EVERY == 0:
            time.append(world.time)
            kinetic.append(body.kinetic_energy())
            if has_energy:
                total.append(kinetic[-1] + _elastic_energy(body, point))
    return {"time": time, "kinetic": kinetic, "total": total, "frozen": body.is_frozen}


def _elastic_energy(body: Body, point: Point) -> float:
    """Return the elastic energy of a law that has one [J]."""
    if point["law"] != "virial":
        return body.elastic_energy()
    F, now = body.deformations(), body.volumes()
    per_volume = (F**2).sum(axis=(1, 2)) - 5  # to be multiplied by the current volume, J V0
    lam = YOUNG * point["poisson"] / ((1 + point["poisson"]) * (1 - 2 * point["poisson"]))
    return float(0.5 * lam * (now @ per_volume + 2 * EDGE**3))


def growth(numbers: Numbers) -> float:
    """Return the growth of the mean kinetic energy from the first to the last quarter of the run, as a ratio.

    The result is infinite if the body failed.
    """
    kinetic = numbers["kinetic"]
    quarter = max(1, len(kinetic) // 4)
    return math.inf if numbers["frozen"] else float(np.mean(kinetic[-quarter:]) / np.mean(kinetic[:quarter]))


def damping_ratio(numbers: Numbers) -> float:
    """Return the measured damping as a fraction zeta of the critical damping.

    Kinetic energy decays at the rate 2 zeta omega. omega is the angular frequency of waves twice as long as
    the cube's edge.
    """
    time, kinetic = np.array(numbers["time"]), np.array(numbers["kinetic"])
    early = time < 5.0
    rate = -float(np.polyfit(time[early], np.log(kinetic[early]), 1)[0])
    return rate / (2 * math.pi * math.sqrt(YOUNG / DENSITY) / EDGE)


def conclude(results: Results) -> Section:
    """Judge whether energy accumulates if and only if the stress has no energy."""
    undamped = {
        nu: results.one(law="virial", poisson=nu, damping=0.0, substeps=6) for nu in (0.1, CONSERVATIVE, 0.4)
    }
    with_energy = results.one(law="st_venant_kirchhoff", poisson=0.1)
    grown = {nu: growth(numbers) for nu, numbers in undamped.items()}
    conserved = [undamped[CONSERVATIVE], with_energy]
    drift = max(float(np.ptp(n["total"]) / n["total"][0]) for n in conserved)
    least = _least_damping(results)
    zeta = damping_ratio(results.one(law="virial", poisson=CONSERVATIVE, damping=least))
    after = max(growth(n) for _, n in results.where(law="virial", damping=least))
    accumulates = min(grown[0.1], grown[0.4]) > GROWS
    stops = after < 1.0 and zeta < LITTLE
    controls = max(growth(n) for n in conserved) < STAYS
    agrees = accumulates and stops and controls
    measured = (
        f"undamped, kinetic energy of the last quarter over the first: {_words(undamped[0.1])} at nu = 0.1, "
        f"{_words(undamped[0.4])} at 0.4; with damping of {100 * zeta:.1f} % of the critical: {after:.2g} or "
        "less"
    )
    cause = (
        f"the stress is no derivative of an energy: at nu = 1/4, where it is, the ratio is "
        f"{grown[CONSERVATIVE]:.3f}, and under St. Venant-Kirchhoff {growth(with_energy):.3f}; their total "
        f"energy stays to {100 * drift:.1g} %"
    )
    rows = tuple(
        (
            p["law"],
            p["poisson"],
            p["damping"],
            p["substeps"],
            _words(n),
            float(f"{n['time'][-1]:.1f}"),
        )
        for p, n in results.where()
    )
    columns = ("law", "nu [1]", "damping [N s/m]", "substeps", "last quarter over first [1]", "until [s]")
    caption = (
        "Kinetic energy, means over a second: grey where nothing may accumulate, coloured for the thesis's "
        "law. Lines that end early have run away."
    )
    return Section(
        (
            "A floating cube starts stretched and twisted."
            + "".join(
                f" With steps a quarter as long, at nu = {p['poisson']}: {_words(n)}."
                for p, n in results.where(law="virial", substeps=24)
            ),
            cause[0].upper() + cause[1:] + ".",
        ),
        (
            Finding(
                "energy-drift",
                measured,
                Verdict.AGREES if agrees else Verdict.DIFFERS,
                ""
                if agrees
                else f"limits for growth, rest and damping are {GROWS}, {STAYS}, {LITTLE}; {cause}",
            ),
        ),
        (Table("growth", "Kinetic energy, late over early", columns, rows),),
        (Plot("kinetic", caption, lambda figure: _draw(figure, results)),),
    )


def _least_damping(results: Results) -> float:
    """Return the smallest damping that stops the growth for every Poisson's ratio [N s/m].

    If no damping does, return the largest that was tried.
    """
    damped = {p["damping"] for p, _ in results.where(law="virial") if p["damping"] > 0.0}
    stops = [b for b in damped if max(growth(n) for _, n in results.where(law="virial", damping=b)) < 1.0]
    return float(min(stops) if stops else max(damped))


def _words(numbers: Numbers) -> str:
    if numbers["frozen"]:
        return f"runs away after {numbers['time'][-1]:.1f} s"
    return f"{growth(numbers):.2f}"


def _draw(figure: Any, results: Results) -> None:
    axes = figure.add_subplot()
    for p, n in results.where():
        if p["substeps"] != 6 or (p["damping"] and p["poisson"] not in (0.1, 0.4)):
            continue
        per_second = round(1 / (READ_EVERY * DT))
        count = len(n["kinetic"]) // per_second
        means = np.reshape(n["kinetic"][: count * per_second], (count, per_second)).mean(axis=1)
        conserves = p["law"] != "virial" or p["poisson"] == CONSERVATIVE
        name = "St. V.-K." if p["law"] != "virial" else "virial"
        label = f"{name}, nu = {p['poisson']:g}, b = {p['damping']:g} N s/m"
        color = "gray" if conserves else f"C{round(10 * p['poisson'])}"
        line = ":" if p["damping"] else "--" if name != "virial" else "-"
        axes.plot(np.arange(count) + 0.5, means, line, color=color, label=label)
    axes.set_yscale("log")
    axes.set_ylim(bottom=1.0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("kinetic energy [J]")
    figure.legend(loc="outside right upper", fontsize="small")


ENERGY_DRIFT = Experiment(
    "energy-drift",
    "Energy that accumulates",
    "section 6.4",
    ("energy-drift",),
    points,
    measure,
    conclude,
)
