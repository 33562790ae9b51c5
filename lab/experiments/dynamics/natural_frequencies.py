"""First natural frequencies of a cantilever and a free beam under every law (not in the thesis).

A beam at rest receives a small velocity in the shape of its first mode and vibrates. The zeros of its
deflection give the frequency. The references are a Timoshenko beam, and finite elements on the same mesh.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lab.experiments.dynamics.beam_theory import euler_bernoulli_frequency
from lab.experiments.dynamics.compared_laws import TETRAHEDRAL, laws_of
from lab.experiments.dynamics.swinging_beam import (
    BEAM,
    DENSITY,
    HEIGHT,
    LENGTH,
    MATERIAL,
    NEEDS_DAMPING,
    POISSON,
    WIDTH,
    YOUNG,
    beam_mesh,
    mode_shape,
    swing,
    theory,
)
from lab.experiments.dynamics.vibration_modes import bending_frequency
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
)
from lab.experiments.judgement import judged_but_for
from taichi_soft.core.types import LawName

COARSE, FINE, FINEST = 2, 4, 6  # cells along the height
SUPPORTS = {"cantilever": "cantilever-frequency", "free": "free-beam-frequency"}
ELEMENTS = "finite elements"

SAME_MESH = 0.01
"""Largest relative difference between a law on tetrahedra and finite elements with the same mesh and
masses."""
EXTRAPOLATED = 0.02
"""Largest relative difference between theory and the extrapolation from two meshes. Finite elements differ
from theory by 1.4 %."""


def points(effort: Effort) -> list[Point]:
    """List the points: every law and finite elements on the coarse mesh, and a selection on finer meshes."""
    laws: list[Point] = [{"law": law, "cells": FINE} for law in ("virial", "springs")]
    laws += [{"law": law, "cells": COARSE} for law in laws_of(effort)]
    elements: list[Point] = [{"law": ELEMENTS, "cells": cells} for cells in (COARSE, FINE)]
    if effort is Effort.FULL:
        laws += [{"law": law, "cells": FINE} for law in laws_of(effort) if law not in ("virial", "springs")]
        laws += [{"law": "virial", "cells": FINEST}]
        elements += [{"law": ELEMENTS, "cells": FINEST}]
    return laws + elements


def measure(point: Point) -> Numbers:
    """Measure the frequency of both beams [Hz] and the growth of their amplitudes per period.

    Both numbers are 0 for a beam that fails.
    """
    mesh = beam_mesh(point["cells"])
    numbers: Numbers = {"tets": len(mesh.tets)}
    for support in SUPPORTS:
        shape, held = mode_shape(mesh, support)
        if point["law"] == ELEMENTS:
            for key, is_lumped in ((support, True), (f"{support}_consistent", False)):
                numbers[key] = bending_frequency(mesh, MATERIAL, shape, held, is_lumped=is_lumped)
        else:
            numbers[support], numbers[f"{support}_growth"] = swing(mesh, point["law"], support)
    return numbers


def conclude(results: Results) -> Section:
    """Compare laws with finite elements on the same mesh, and the extrapolation with theory."""
    findings = [_finding(results, support, claim) for support, claim in SUPPORTS.items()]
    tables = [_table(results, support) for support in SUPPORTS]
    fine = results.one(law="virial", cells=FINE)
    tends = {
        law: _extrapolated(results, "cantilever", law) / theory("cantilever") for law in ("virial", "springs")
    }

    def draw_laws(figure: Any) -> None:
        axes = figure.add_subplot()
        laws = _laws(results)
        places = np.arange(len(laws))
        for support, shift, color in zip(SUPPORTS, (-0.18, 0.18), ("tab:blue", "tab:orange"), strict=True):
            heights = [results.one(law=law, cells=COARSE)[support] / theory(support) for law in laws]
            axes.bar(places + shift, heights, 0.34, color=color, label=support)
            elements = results.one(law=ELEMENTS, cells=COARSE)[support] / theory(support)
            axes.axhline(elements, color=color, ls="--", lw=1, label=f"{support}, finite elements")
        axes.axhline(1, color="black", lw=1)
        axes.set_xticks(places, [law.replace("_", " ") for law in laws], rotation=40, ha="right")
        axes.set_ylabel("frequency over Timoshenko's [1]")
        axes.set_ylim(0, 2)
        axes.legend(ncols=2, fontsize=8, loc="upper left")

    def draw_meshes(figure: Any) -> None:
        axes = figure.add_subplot()
        for support, color in zip(SUPPORTS, ("tab:blue", "tab:orange"), strict=True):
            for law, style in (("virial", "o-"), (ELEMENTS, "x:")):
                rows = sorted((point["cells"], numbers[support]) for point, numbers in results.where(law=law))
                cells, frequencies = np.array(rows).T
                axes.plot(
                    cells**-2, frequencies / theory(support), style, color=color, label=f"{support}, {law}"
                )
            promised = _extrapolated(results, support) / theory(support)
            axes.plot(0, promised, "*", color=color, ms=10, label=f"{support}, extrapolated")
        axes.axhline(1, color="black", lw=1)
        axes.set_xlabel("1 / (cells along the height)^2 [1]")
        axes.set_ylabel("frequency over Timoshenko's [1]")
        axes.legend(fontsize=8)

    return Section(
        (
            f"A beam of {LENGTH} x {WIDTH} x {HEIGHT} m (E = {YOUNG:g} Pa, nu = {POISSON}, {DENSITY:g} "
            "kg/m^3), attached at one end or free, starts with the velocity of its first bending mode. Its "
            "frequency is read from zero crossings. Laws on tetrahedra and springs are undamped. The others "
            "have no energy and get the damping that they need, which the tables list. Finite elements: "
            "scikit-fem, linear tetrahedra on the same mesh, with the mass at the vertices.",
            "Linear tetrahedra are too stiff in bending, in finite elements as in the laws of chapter 6: "
            f"with {COARSE} cells along the height a cantilever is {_excess(results, 'cantilever', COARSE)} "
            f"too fast, with {FINE} ({fine['tets']} tetrahedra) {_excess(results, 'cantilever', FINE)}. "
            f"Extrapolated to an infinitely fine mesh, it has {tends['virial']:.2f} times Timoshenko's "
            f"frequency, and one of springs {tends['springs']:.2f} times.",
        ),
        tuple(findings),
        tuple(tables),
        (
            Plot("laws", f"First frequencies under every law, {COARSE} cells along the height.", draw_laws),
            Plot("meshes", "The same as the mesh is refined, and what this promises at zero.", draw_meshes),
        ),
    )


def _laws(results: Results) -> list[str]:
    """List the laws on the coarse mesh, in order."""
    return [point["law"] for point, _ in results.where(cells=COARSE) if point["law"] != ELEMENTS]


def _excess(results: Results, support: str, cells: int) -> str:
    return f"{results.one(law='virial', cells=cells)[support] / theory(support) - 1:.0%}"


def _extrapolated(results: Results, support: str, law: LawName = "virial") -> float:
    """Extrapolate the frequency to cells of zero size from the two finest meshes (error of second order)."""
    rows = sorted((point["cells"], numbers[support]) for point, numbers in results.where(law=law))
    (coarse, low), (fine, high) = rows[-2:]
    return float((fine**2 * high - coarse**2 * low) / (fine**2 - coarse**2))


def _finding(results: Results, support: str, claim: str) -> Finding:
    elements = results.one(law=ELEMENTS, cells=COARSE)[support]
    parts = {law: results.one(law=law, cells=COARSE)[support] / elements - 1 for law in _laws(results)}
    worst = max(abs(parts[law]) for law in TETRAHEDRAL)
    expected, promised = theory(support), _extrapolated(results, support)
    agrees = worst < SAME_MESH and abs(promised / expected - 1) < EXTRAPOLATED
    others = [part for law, part in parts.items() if law not in TETRAHEDRAL and part > -1]  # -1: failed beam
    return judged_but_for(
        claim,
        f"the laws on tetrahedra are within {worst:.1g} of finite elements on the same mesh, which is "
        f"{elements / expected - 1:+.0%} above Timoshenko's {expected:.4g} Hz, and tend to {promised:.4g} Hz "
        f"({promised / expected - 1:+.1%}) as it is refined; laws along edges differ from finite elements on "
        f"the same mesh by {min(others):+.0%} to {max(others):+.0%}",
        agrees,
        f"the model, where it is not within {SAME_MESH:.0%} of finite elements on the same mesh "
        f"({worst:.2g}); the mesh, where it is, and the extrapolation misses by more than {EXTRAPOLATED:.0%}",
        [law for law, part in parts.items() if law not in TETRAHEDRAL and abs(part) >= SAME_MESH],
        f"they are {SAME_MESH:.0%} or more away from finite elements on the same mesh",
    )


def _table(results: Results, support: str) -> Table:
    expected = theory(support)
    rows: list[tuple[Any, ...]] = []
    for point, numbers in results.where():
        law, frequency = point["law"], numbers[support]
        elements = results.where(law=ELEMENTS, cells=point["cells"])
        over = frequency / elements[0][1][support] if elements else float("nan")
        damping, after = NEEDS_DAMPING.get(law, 0.0), numbers.get(f"{support}_growth", 1.0)
        rows.append((law, point["cells"], damping, after, frequency, over, frequency / expected))
        if law == ELEMENTS:
            other = numbers[f"{support}_consistent"]
            name = f"{ELEMENTS}, mass spread"
            rows.append((name, point["cells"], 0.0, 1.0, other, other / frequency, other / expected))
    beam = euler_bernoulli_frequency(BEAM, is_held=support == "cantilever")
    for name, frequency in (("Timoshenko", expected), ("Euler and Bernoulli", beam)):
        rows.append((name, "", 0.0, 1.0, frequency, "", frequency / expected))
    columns = ("cells along the height", "damping [N s/m]", "swing after a period, over before [1]")
    return Table(
        support,
        f"First frequency, {support}. 0: the beam broke",
        ("law", *columns, "frequency [Hz]", "over finite elements [1]", "over Timoshenko [1]"),
        tuple(rows),
    )


FREQUENCIES = Experiment(
    "natural-frequencies",
    "Natural frequencies of beams",
    "beyond the thesis: theory of beams",
    tuple(SUPPORTS.values()),
    points,
    measure,
    conclude,
)
