"""Forces by faces and by the virial theorem, and the cost of both compared with springs (thesis 6.6, 6.7)."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

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
from lab.experiments.irregular import cube
from lab.experiments.judgement import judged, judged_but_for
from taichi_soft import Material, box, internal_forces, voronoi_graph
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

LAWS: tuple[LawName, ...] = ("virial", "face", "springs", "cmpm")
MATERIAL = Material(young=1e5, poisson=0.3, density=1000.0, damping=0.1, damping_ratio=0.0)
SUBSTEPS, SUBSTEP = 20, 1e-5  # number of substeps, and their length [s], far below all stability limits
SAME = 1e-9
"""Largest relative difference between two forces that count as equal. Round-off in float64 causes smaller
differences."""
ALIKE = 1.25
"""Largest ratio of two times that count as equal."""
CLEARLY = 1.5
"""Smallest ratio of the times of two laws at which one law counts as clearly faster."""


def points(effort: Effort) -> list[Point]:
    """List the points: forces with the thesis's options or with all options, and times on one mesh."""
    is_full = effort is Effort.FULL
    modes = [("linear", "tolerant")]
    if is_full:
        modes = [(s, f) for s in ("linear", "exact") for f in ("tolerant", "off", "recover")]
    forces = [{"kind": "forces", "strain": strain, "flips": flips} for strain, flips in modes]
    return [*forces, {"kind": "cost", "cells": 10 if is_full else 6, "repeats": 41 if is_full else 9}]


def measure(point: Point) -> Numbers:
    """Measure the differences between the forces, or the times of a substep with each law in alternation."""
    return _forces(point) if point["kind"] == "forces" else _cost(point)


def _forces(point: Point) -> Numbers:
    """Return the largest difference between the forces of both methods, as a fraction of the largest force.

    Also return the numbers of inverted tetrahedra and of all tetrahedra that were compared.
    """
    mesh, rng = cube(3, 1), np.random.default_rng(1)
    difference, flipped, looked_at = 0.0, 0, 0
    for amount in (1e-3, 0.03, 0.1, 0.3, 1.0):
        for _ in range(4):
            x = mesh.vertices + rng.normal(size=mesh.vertices.shape) * amount * mesh.edge_lengths.mean()
            faces, virial = (
                internal_forces(mesh, MATERIAL, x, law=law, strain=point["strain"], flips=point["flips"])
                for law in ("face", "virial")
            )
            difference = max(difference, float(np.abs(faces - virial).max() / np.abs(virial).max()))
            corners = x[mesh.tets]
            flipped += int((np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0).sum())
            looked_at += len(mesh.tets)
    return {"difference": difference, "flipped": flipped, "looked_at": looked_at}


def _cost(point: Point) -> Numbers:
    mesh = box((1.0, 1.0, 1.0), (point["cells"],) * 3)
    worlds = {}
    for law in LAWS:
        worlds[law] = bare_world(floor=None, retries=0)
        worlds[law].add_body(mesh, MATERIAL, law=law)
        worlds[law].build()
    seconds: dict[str, list[float]] = {law: [] for law in LAWS}
    for turn in range(point["repeats"] + 2):
        for law, world in worlds.items():
            start = perf_counter()
            world.step(SUBSTEPS * SUBSTEP, SUBSTEPS)
            if turn > 1:  # the first two rounds warm up
                seconds[law].append((perf_counter() - start) / SUBSTEPS)
    return {
        "seconds": seconds,
        "tets": len(mesh.tets),
        "edges": len(mesh.edges),
        "corners": len(voronoi_graph(mesh).corner_edge),
    }


def conclude(results: Results) -> Section:
    """Judge the forces and the ratios of times.

    The ratio of times is computed in each round, so that a slow phase of the machine affects both laws.
    """
    forces = results.where(kind="forces")
    cost = results.one(kind="cost")
    virial = np.array(cost["seconds"]["virial"])
    ratios = {law: float(np.median(np.array(cost["seconds"][law]) / virial)) for law in LAWS}
    difference = max(numbers["difference"] for _, numbers in forces)
    flipped, looked_at = (sum(n[key] for _, n in forces) for key in ("flipped", "looked_at"))

    are_faster = [law for law in ("springs", "cmpm") if ratios[law] < 1 / CLEARLY]
    why_slower = (
        "the implementation: no inverse as in eq. 6.18 is needed here, and CMPM finds the normals of "
        f"the Voronoi faces anew, of {cost['corners']} corners on this body, each from four "
        f"vertices: {cost['corners'] / cost['tets']:.1f} times as much to read. Or the reading: the "
        "thesis steps CMPM implicitly, a hundred times as far at once (see implicit-step)"
    )

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        axes.bar(LAWS, [float(np.median(cost["seconds"][law])) * 1e6 for law in LAWS])
        axes.set_ylabel("time of a substep [µs]")

    return Section(
        (
            "Forces of both methods of chapter 6 are compared on bodies deformed at random. Costs are "
            f"those of a falling body of {cost['tets']} tetrahedra and {cost['edges']} edges under each "
            "law, on one core.",
        ),
        (
            judged(
                "methods-alike",
                f"forces differ by {difference:.1g} of the largest, {flipped} of {looked_at} tetrahedra "
                f"being flipped; a substep by faces takes {ratios['face']:.2f} times that by the virial "
                "theorem",
                difference < SAME and 1 / ALIKE < ratios["face"] < ALIKE,
                "forces are the same: what differs is how they are computed"
                if difference < SAME
                else "the forces are not the same",
            ),
            judged_but_for(
                "springs-faster",
                f"a substep of the same body takes {ratios['springs']:.2f} times that of the virial theorem "
                f"with springs, {ratios['cmpm']:.2f} times with CMPM",
                bool(are_faster),
                why_slower,
                [law for law in ("springs", "cmpm") if law not in are_faster],
                why_slower,
            ),
        ),
        (
            Table(
                "costs",
                "Time of a substep",
                ("law", "time [µs]", "over virial [1]"),
                tuple((law, float(np.median(cost["seconds"][law])) * 1e6, ratios[law]) for law in LAWS),
            ),
        ),
        (Plot("costs", "Time of a substep of the same body under each law.", draw),),
    )


METHODS_COST = Experiment(
    "methods-cost",
    "Faces, the virial theorem and springs",
    "sections 6.6 and 6.7",
    ("methods-alike", "springs-faster"),
    points,
    measure,
    conclude,
    is_timing=True,
)
"""The experiment on the cost of the laws of chapter 6."""
