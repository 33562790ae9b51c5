"""Small dihedral angles and a high Poisson's ratio reduce stability (thesis section 6.6).

A cube is degraded by flattening one inner tetrahedron or one layer of cells. The largest stable step of the
cube is estimated at rest, and measured by running the cube with increasing steps.
"""

from __future__ import annotations

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
from taichi_soft import FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, box
from taichi_soft.bodies.stability import stable_step
from taichi_soft.elements.laws import element_model
from taichi_soft.world.bare import bare_world

YOUNG, DENSITY = 1e6, 1000.0
KINDS = ("tetrahedron", "layer")
SHARES = (1.0, 0.3, 0.1, 0.03, 0.01)
"""Heights of the flattened part, as fractions of its regular height."""
STEPS = np.geomspace(3e-4, 9e-3, 44)  # lengths of substeps, 8 % apart [s]
RUN, GROWN = 400, 100.0
"""`RUN` is the number of substeps in a run. The step is too long if the kinetic energy grows by more than the
factor `GROWN`."""
HALVED = 0.8
"""Stability counts as lost if the largest stable step is below this fraction of the largest stable step of
the regular cube with nu = 0.1."""


def points(effort: Effort) -> list[Point]:
    """List the points: one per Poisson's ratio. The cubes of a point run in one world."""
    ratios = (0.1, 0.4) if effort is Effort.QUICK else (0.0, 0.1, 0.2, 0.3, 0.4, 0.45)
    return [{"poisson": nu} for nu in ratios]


def spoilt_cube(kind: str, share: float) -> TetMesh:
    """Make a cube of 1 m with 3 cells per side, with a part flattened to the fraction `share` of its height.

    Args:
        kind: "tetrahedron" or "layer".
    """
    mesh = box((1.0, 1.0, 1.0), (3, 3, 3))
    x = mesh.vertices.copy()
    if kind == "layer":
        x[np.abs(x[:, 2] - x[:, 2].min() - 2 / 3) < 1e-6, 2] -= (1 - share) / 3
        return TetMesh(x, mesh.tets)
    middle = mesh.tets[np.argmin(np.linalg.norm(x[mesh.tets].mean(axis=1) - x.mean(axis=0), axis=1))]
    top, base = middle[0], x[middle[1:]]
    normal = np.cross(base[1] - base[0], base[2] - base[0])
    normal /= np.linalg.norm(normal)
    x[top] -= (1 - share) * ((x[top] - base[0]) @ normal) * normal
    return TetMesh(x, mesh.tets)


def cubes() -> list[tuple[str, float, TetMesh]]:
    """List kind, share and mesh of all cubes. The regular cube is the first."""
    spoilt = [(kind, share, spoilt_cube(kind, share)) for kind in KINDS for share in SHARES[1:]]
    return [("sound", 1.0, spoilt_cube("layer", 1.0)), *spoilt]


def measure(point: Point) -> Numbers:
    """Measure the stability of each cube.

    Returns: "angle", smallest dihedral angle [degrees]; "limit", estimate of the largest stable step [s];
        "held", longest step at which the cube was stable [s]; "broke", shortest step at which it was unstable
        [s].
    """
    meshes = [mesh for _, _, mesh in cubes()]
    material = Material(YOUNG, point["poisson"], DENSITY, damping_ratio=0.0)
    world = bare_world(gravity=(0, 0, 0), retries=0)
    bodies = [
        world.add_body(mesh, material, position=(3.0 * i, 0, 3.0), law="virial")
        for i, mesh in enumerate(meshes)
    ]
    world.build()
    starts = [body.positions() for body in bodies]
    pushes = [1e-3 * np.random.default_rng(0).normal(size=start.shape) for start in starts]
    held = np.zeros(len(bodies))
    broke = np.full(len(bodies), np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        warnings.simplefilter("ignore", UnstableStepWarning)
        for h in STEPS:
            first = []
            for body, start, push in zip(bodies, starts, pushes, strict=True):
                body.set_motion(start, push)
                first.append(body.kinetic_energy())
            world.step(RUN * h, RUN)
            for i, body in enumerate(bodies):
                if np.isfinite(broke[i]):
                    continue
                if body.is_frozen or body.kinetic_energy() > GROWN * first[i]:
                    broke[i] = h
                else:
                    held[i] = h
    model = element_model("virial")
    return {
        "angle": [float(mesh.quality.min_dihedral.min()) for mesh in meshes],
        "limit": [stable_step(mesh, material, model).limit for mesh in meshes],
        "held": held.tolist(),
        "broke": broke.tolist(),
    }


def conclude(results: Results) -> Section:
    """Judge how the largest stable step depends on the smallest angle and on Poisson's ratio."""
    ratios = sorted(point["poisson"] for point, _ in results.where())
    by_ratio = {nu: results.one(poisson=nu) for nu in ratios}
    names = [(kind, share) for kind, share, _ in cubes()]
    usual = by_ratio[0.1]
    losses = {kind: usual["held"][names.index((kind, SHARES[-1]))] / usual["held"][0] for kind in KINDS}
    angle = min(usual["angle"])
    high = by_ratio[0.4]["held"][0] / usual["held"][0]
    by_angle, by_nu = max(losses.values()) < HALVED, high < HALVED
    measured = (
        f"at nu = 0.1 a tetrahedron flattened to 1 % of its height takes the largest step that held to "
        f"{losses['tetrahedron']:.2f} of the sound cube's, a layer to {losses['layer']:.2f} (smallest angle "
        f"{angle:.1f} degrees); nu = 0.4 takes it to {high:.2f} of that at 0.1"
    )
    why = ""
    if not (by_angle and by_nu):
        small = "angles" if not by_angle else "a high Poisson's ratio"
        why = f"the model: {small} leave the step above {HALVED} of the best"
    rows = tuple(
        (nu, *name, *(float(f"{value:.3g}") for value in values))
        for nu, n in by_ratio.items()
        for name, *values in zip(names, n["angle"], n["limit"], n["held"], n["broke"], strict=True)
    )
    columns = (
        "nu [1]",
        "flattened",
        "to [1]",
        "smallest angle [deg]",
        "estimate [s]",
        "held [s]",
        "broke [s]",
    )
    return Section(
        ("One tetrahedron in the middle of a cube, or one of its three layers, is flattened.",),
        (
            Finding(
                "mesh-quality",
                measured,
                Verdict.AGREES if by_angle and by_nu else Verdict.DIFFERS,
                why,
            ),
        ),
        (Table("steps", "Largest stable steps", columns, rows),),
        (
            Plot(
                "steps",
                "Lines: estimated from the frequencies at rest; bars: between a step that held and one that "
                "broke, 8 % apart.",
                lambda figure: _draw(figure, by_ratio),
                (8.0, 4.0),
            ),
        ),
    )


def _draw(figure: Any, by_ratio: dict[float, Numbers]) -> None:
    kinds = np.array([kind for kind, _, _ in cubes()])
    panels = figure.subplots(1, 2, sharey=True)
    for axes, kind in zip(panels, KINDS, strict=True):
        here = (kinds == kind) | (kinds == "sound")
        for number, (nu, numbers) in enumerate(by_ratio.items()):
            angle, limit, held, broke = (
                np.array(numbers[name])[here] for name in ("angle", "limit", "held", "broke")
            )
            order = np.argsort(angle)
            axes.plot(angle[order], 1e3 * limit[order], color=f"C{number}", label=f"nu = {nu:g}")
            axes.vlines(angle, 1e3 * held, 1e3 * broke, color=f"C{number}", linewidth=4, alpha=0.6)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xticks([1, 3, 10, 30], ["1", "3", "10", "30"])
        axes.set_yticks([1, 2, 4], ["1", "2", "4"])
        axes.minorticks_off()
        axes.set_xlabel("smallest dihedral angle [deg]")
        axes.set_title(f"one {kind} flattened")
    panels[0].set_ylabel("largest stable step [ms]")
    panels[1].legend()


MESH_QUALITY = Experiment(
    "mesh-quality",
    "Small angles and high Poisson's ratios",
    "section 6.6",
    ("mesh-quality",),
    points,
    measure,
    conclude,
)
