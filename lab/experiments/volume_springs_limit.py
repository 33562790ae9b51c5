"""Largest nu for which springs that preserve volume are stable (thesis section 5.2)."""

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
from lab.experiments.judgement import Span
from taichi_soft import Material, TetMesh, internal_forces
from taichi_soft.meshing.arrays import FloatArray

YOUNG, DENSITY = 3e6, 4e3  # values of the thesis [Pa, kg/m^3]; it gives no damping and no step
CELLS = 3
STEADY = 0.1
"""Largest growth rate of a motion that counts as steady [1/s]. Round-off can cause a growth of 10 % per
second."""
THESIS_LIMIT, CLOSE = 0.3, 0.05


def points(effort: Effort) -> list[Point]:
    """List the points: several dampings and none, on one irregular mesh.

    A full report has two irregular meshes and a regular one.
    """
    is_full = effort is Effort.FULL
    dampings = (0.0, 30.0, 100.0, 300.0, 1000.0, 3000.0) if is_full else (0.0, 1000.0, 3000.0)
    ratios = [round(0.05 * k, 2) for k in range(10)] if is_full else [0.0, 0.1, 0.2, 0.3, 0.4]
    seeds = (None, 1, 2) if is_full else (1,)
    return [{"seed": seed, "damping": b, "poisson": ratios} for seed in seeds for b in dampings]


def measure(point: Point) -> Numbers:
    """Measure the stability of a cube between fixed plates, for each nu.

    Returns: "growth", growth rate of the fastest growing small motion [1/s]; "step", largest step of leapfrog
        without damping [s], 2 divided by the highest angular frequency.
    """
    mesh = cube(CELLS, point["seed"])
    plates = Plates(mesh)
    mass = np.repeat(mesh.vertex_volumes * DENSITY, 3)[plates.free][:, None]
    springs, volume = (_gradient(plates, nu) for nu in (0.0, 0.3))  # at rest, gradients are linear in nu
    braking = -point["damping"] * _edge_matrix(mesh)[np.ix_(plates.free, plates.free)]
    zero, one = np.zeros_like(springs), np.eye(len(springs))
    growth, step = [], []
    for nu in point["poisson"]:
        acceleration = (springs + (volume - springs) * nu / 0.3) / mass
        rates = np.linalg.eigvals(np.block([[zero, one], [acceleration, braking / mass]]))
        growth.append(float(rates.real.max()))
        step.append(float(2 / np.sqrt(np.abs(np.linalg.eigvals(acceleration)).max())))
    return {"growth": growth, "step": step}


def _gradient(plates: Plates, nu: float) -> FloatArray:
    material = Material(YOUNG, nu, DENSITY, damping_ratio=0.0)

    def forces(x: FloatArray) -> FloatArray:
        return internal_forces(plates.mesh, material, x, law="volume_springs")

    return np.asarray(plates.gradient(forces, plates.mesh.vertices).toarray())


def _edge_matrix(mesh: TetMesh) -> FloatArray:
    """Return the damping matrix of velocities along the edges for b = 1 (eq. 3.9), (3 n, 3 n)."""
    total = np.zeros((3 * len(mesh.vertices),) * 2)
    for p, q in mesh.edges:
        n = mesh.vertices[q] - mesh.vertices[p]
        along = np.append(-n, n) / np.linalg.norm(n)
        rows = np.append(3 * p + np.arange(3), 3 * q + np.arange(3))
        total[np.ix_(rows, rows)] += np.outer(along, along)
    return total


def conclude(results: Results) -> Section:
    """Judge the largest nu at which no motion grows, for each damping."""
    results.one(seed=1, damping=0.0)
    limits: dict[tuple[int | None, float], float] = {}
    for point, numbers in results.where():
        steady = [growth < STEADY for growth in numbers["growth"]]
        count = steady.index(False) if False in steady else len(steady)
        limits[point["seed"], point["damping"]] = point["poisson"][count - 1] if count else -1.0
    irregular = [limit for (seed, _), limit in limits.items() if seed is not None]
    if all(abs(limit - THESIS_LIMIT) < CLOSE for limit in irregular):
        verdict, why = Verdict.AGREES, ""
    elif min(irregular) < THESIS_LIMIT < max(irregular) + CLOSE:
        verdict = Verdict.UNKNOWN
        why = (
            "the thesis tells neither damping nor mesh, and both move the limit. The force of eq. 5.5 pulls "
            "all edges of a tetrahedron alike, whichever of them has grown: it has no energy, and on "
            "irregular meshes the cube gains some in each vibration, with any nu above 0"
        )
    else:
        verdict, why = Verdict.DIFFERS, "the limit lies elsewhere for each damping that was tried"
    ((point, undamped),) = results.where(seed=1, damping=0.0)
    dampings = sorted({damping for _, damping in limits})

    def listed(is_regular: bool) -> str:
        by_damping = (
            Span(
                [
                    limit
                    for (seed, b), limit in limits.items()
                    if b == damping and (seed is None) == is_regular
                ]
            )
            for damping in dampings
        )
        return ", ".join(f"{span:g}" for span in by_damping)

    told = f"with b = {', '.join(f'{b:g}' for b in dampings)} N s/m {listed(False)} on irregular meshes"
    if any(seed is None for seed, _ in limits):
        told += f", {listed(True)} on a regular grid"

    def draw(figure: Any) -> None:
        axes = figure.add_subplot()
        for place, n in results.where(seed=1):
            label = f"b = {place['damping']:g} N s/m"
            axes.plot(place["poisson"], np.maximum(n["growth"], 1e-3), "o-", ms=3, label=label)
        axes.axhline(STEADY, color="k", lw=0.8, ls="--", label="steady below")
        axes.set_yscale("log")
        axes.set_xlabel("Poisson's ratio [1]")
        axes.set_ylabel("growth of the worst motion [1/s]")
        axes.legend(fontsize="small")

    return Section(
        (
            "Small motions of the cube of figures 5.1 and 5.2 between plates at rest, from the gradient of "
            "the forces. Each is a vibration that grows or fades, with any integrator.",
        ),
        (
            Finding(
                "volume-springs-limit",
                f"largest nu that was tried and below which nothing grows: {told}; undamped, a motion grows "
                f"at {undamped['growth'][-1]:.0f} 1/s with nu = {point['poisson'][-1]:g}. The largest "
                f"step of leapfrog falls from {undamped['step'][0]:.1e} to {undamped['step'][-1]:.1e} s",
                verdict,
                why,
            ),
        ),
        (
            Table(
                "growth",
                "Growth of the worst motion",
                ("mesh", "damping [N s/m]", "nu [1]", "growth [1/s]", "largest step [s]"),
                tuple(
                    (_mesh(place["seed"]), place["damping"], *row)
                    for place, n in results.where()
                    for row in zip(place["poisson"], n["growth"], n["step"], strict=True)
                ),
            ),
        ),
        (
            Plot(
                "growth",
                "What grows in an irregular cube, by nu and damping; 0.001 and less is drawn there.",
                draw,
            ),
        ),
    )


def _mesh(seed: int | None) -> str:
    return "regular grid" if seed is None else f"irregular mesh {seed}"


VOLUME_SPRINGS_LIMIT = Experiment(
    "volume-springs-limit",
    "The limit of springs that keep volume",
    "section 5.2",
    ("volume-springs-limit",),
    points,
    measure,
    conclude,
)
"""The experiment on the limit of springs that preserve volume."""
