"""Effect of CMPM's shear modulus on the volume of a deformed body (thesis chapter 5, introduction)."""

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
from taichi_soft import Material, internal_forces

YOUNG, DENSITY = 3e6, 4e3  # values of chapter 5 [Pa, kg/m^3]
WAYS = {"stretched": (0.0, 0.0, 1.0), "pressed": (0.0, 0.0, -1.0), "sheared": (1.0, 0.0, 0.0)}
AMOUNT = {"stretched": 0.2, "pressed": 0.2, "sheared": 0.4}
LARGEST = 0.5
"""Largest shear modulus, as a fraction of E. It is the shear modulus of a material with nu = 0."""


def points(effort: Effort) -> list[Point]:
    """List the points: each deformation with several shear moduli, on one irregular mesh or on three."""
    is_full = effort is Effort.FULL
    moduli = (0.05, 0.1, 0.2, 0.35, LARGEST) if is_full else (0.1, LARGEST)
    seeds = (1, 2, 3) if is_full else (1,)
    return [{"way": way, "seed": seed, "modulus": g} for seed in seeds for way in WAYS for g in moduli]


def measure(point: Point) -> Numbers:
    """Measure the volume of a cube that is deformed by plates at its ends, relative to the rest volume."""
    mesh = cube(3, point["seed"])
    plates = Plates(mesh)
    material = Material(YOUNG, 0.3, DENSITY, shear_modulus=point["modulus"] * YOUNG, damping_ratio=0.0)
    amounts = [AMOUNT[point["way"]] * share for share in (0.5, 1.0)]
    states = plates.path(
        lambda x: internal_forces(mesh, material, x, law="cmpm"), WAYS[point["way"]], amounts
    )
    corners = [x[mesh.tets] for x in states]
    volumes = [float(np.linalg.det(x[:, 1:] - x[:, :1]).sum() / 6 / mesh.volume) for x in corners]
    return {"amount": amounts[: len(states)], "volume": volumes}


def conclude(results: Results) -> Section:
    """Judge whether a larger shear modulus reduces the change of volume, for each deformation and mesh."""
    changes: dict[tuple[str, int], dict[float, float]] = {}
    for point, numbers in results.where():
        curve = changes.setdefault((point["way"], point["seed"]), {})
        curve[point["modulus"]] = numbers["volume"][-1] - 1
    for way in WAYS:
        results.one(way=way, seed=1, modulus=LARGEST)
    falls = {key: bool((np.diff(np.abs(list(curve.values()))) < 0).all()) for key, curve in changes.items()}
    holding = [way for way in WAYS if all(falls[key] for key in changes if key[0] == way)]
    told = "; ".join(
        f"{way} by {AMOUNT[way]:.0%}: " + ", ".join(f"{change:+.2%}" for change in curve.values())
        for (way, seed), curve in changes.items()
        if seed == 1
    )
    first = changes["sheared", 1]
    if len(holding) == len(WAYS):
        verdict, why = Verdict.AGREES, ""
    else:
        verdict = Verdict.UNKNOWN if any(falls.values()) else Verdict.DIFFERS
        tally = ", ".join(
            f"{way} on {sum(falls[key] for key in changes if key[0] == way)} of "
            f"{sum(key[0] == way for key in changes)} meshes"
            for way in WAYS
        )
        why = (
            "the reading: the thesis does not say how its body was deformed. The claim holds for a body "
            f"{tally}. A spring across each edge holds back the narrowing of a stretched body, so that its "
            "volume changes more"
        )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for (way, seed), curve in changes.items():
            color = f"C{list(WAYS).index(way)}"
            label = f"{way} by {AMOUNT[way]:.0%}" if seed == 1 else None
            axes.plot(list(curve), np.abs(list(curve.values())), color + "o-", ms=3, label=label)
        axes.set_xlabel("shear modulus over E [1]")
        axes.set_ylabel("change of volume over that at rest [1]")
        axes.set_ylim(bottom=0.0)
        axes.legend()

    return Section(
        (
            "A cube of irregular tetrahedra under CMPM, E = 3 MPa, between plates that are moved apart, "
            "together and sideways, with a shear modulus that is chosen separately.",
        ),
        (
            Finding(
                "shear-modulus-volume",
                f"change of volume with G / E = {', '.join(f'{g:g}' for g in first)}: {told}",
                verdict,
                why,
            ),
        ),
        (
            Table(
                "volumes",
                "Change of volume",
                ("way", "mesh", "G / E [1]", "change over the volume at rest [1]"),
                tuple((way, seed, *row) for (way, seed), curve in changes.items() for row in curve.items()),
            ),
        ),
        (Plot("volumes", "What a larger shear modulus of CMPM does to the volume.", draw),),
    )


SHEAR_MODULUS_VOLUME = Experiment(
    "shear-modulus-volume",
    "The shear modulus and the volume",
    "chapter 5, introduction",
    ("shear-modulus-volume",),
    points,
    measure,
    conclude,
)
"""The experiment on shear modulus and volume."""
