"""One cell: built with what it names and nothing else, dropped or left to itself, and judged."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from taichi_soft import FrozenBodyWarning, Material, TetMesh, World
from taichi_soft.body import Body
from taichi_soft.constants import GRAVITY_EARTH
from taichi_soft.drops.robustness.cells import DAMPINGS, MESHES, Cell
from taichi_soft.drops.robustness.verdict import MOST_SUBSTEPS, Ending, Verdict, judge
from taichi_soft.drops.robustness.wrecks import distance_from_rest, wrecked
from taichi_soft.errors import TaichiSoftError

DROP, DROP_TIME = 2.0, 2.5
"""Height [m] and time [s]: a fall of 0.64 s, an impact, and what bounces falls once more."""

RECOVERY_TIME, CALM_TIME = 10.0, 0.5
"""Within which no tetrahedron may be inside out any more, and for how long to take it as settled [s]."""

REST_SPEED, LONGEST_REST = 1e-4, 60.0
"""At rest is what is slower than so many sizes per second (root mean square over mass). To come there without
gravity a body has as long as waves take to cross it `REST_CROSSINGS` times, and at most so long [s]."""

REST_CROSSINGS = 60.0

MOST_WORK = 2e9
"""Tetrahedra times substeps of a cell, half a minute: what would take more is too slow as well."""


def run_cell(cell: Cell) -> dict[str, Any]:
    """What became of a cell: verdict and reason, and the facts of its mesh and its step. Plain data."""
    mesh = cell_mesh(cell["mesh"], cell["scale"])
    facts: dict[str, Any] = {
        "tets": len(mesh.tets),
        "min_dihedral": float(mesh.quality.min_dihedral.min()),  # [degrees]
        "substeps": None,  # of 1/60 s
        "said": [],
    }
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", FrozenBodyWarning)
        try:
            verdict, reason = _try(cell, mesh, facts)
        except TaichiSoftError as error:
            verdict, reason = Verdict.REFUSED, f"{type(error).__name__}: {error}"
    facts["said"] = sorted({f"{each.category.__name__}: {each.message}" for each in said})
    return {**facts, "verdict": verdict.value, "reason": reason}


@lru_cache(maxsize=128)
def cell_mesh(name: str, scale: float) -> TetMesh:
    """A mesh by its name, all lengths multiplied."""
    mesh = MESHES[name]()
    return mesh if scale == 1.0 else TetMesh(mesh.vertices * scale, mesh.tets)


def _try(cell: Cell, mesh: TetMesh, facts: dict[str, Any]) -> tuple[Verdict, str]:
    material = Material(
        cell["young"], cell["poisson"], cell["density"], **DAMPINGS[cell["damping"]](mesh, cell)
    )
    named = {option: cell[option] for option in ("law", "flips") if cell[option] is not None}
    rest = mesh.vertices - (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    size = float(np.ptp(rest, axis=0).max())
    start = rest if cell["wreck"] is None else wrecked(rest, cell["wreck"], cell["seed"])
    height = (DROP if cell["wreck"] is None else 0.1 * size) - float(min(rest[:, 2].min(), start[:, 2].min()))
    world = World()
    body = world.add_body(mesh, material, position=(0.0, 0.0, size + DROP), **named)
    world.build()
    steps = round((DROP_TIME if cell["wreck"] is None else RECOVERY_TIME) / cell["dt"])
    facts["substeps"] = world.stable_substeps(1 / 60)
    work = steps * world.stable_substeps(cell["dt"]) * len(mesh.tets)
    if facts["substeps"] > MOST_SUBSTEPS:
        return Verdict.TOO_SLOW, f"{facts['substeps']} substeps for 1/60 s ({body.stable_step.stiffest})"
    if work > MOST_WORK:
        return Verdict.TOO_SLOW, f"{work:.2g} substeps of tetrahedra for {steps} steps"
    body.set_motion(start + np.array([0.0, 0.0, height]), np.zeros_like(start))
    run = _Run(world, body, rest, size, cell["dt"])
    if cell["wreck"] is None:
        run.fall(steps)
        fastest = math.sqrt(2 * GRAVITY_EARTH * (height + size))
    else:
        run.recover(steps, material)
        fastest = math.inf
    end = run.ending(fastest, is_wrecked=cell["wreck"] is not None)
    return judge(end)


@dataclass
class _Run:
    """A body on its way."""

    world: World
    body: Body
    rest: np.ndarray[Any, np.dtype[np.float64]]
    size: float  # [m]
    dt: float  # [s]

    def fall(self, steps: int) -> None:
        """Let it fall and bounce."""
        for _ in range(steps):
            if self.body.is_frozen:
                return
            self.world.step(self.dt)

    def recover(self, steps: int, material: Material) -> None:
        """Until no tetrahedron is inside out; then without gravity, braked, until it is at rest."""
        calm = 0
        for _ in range(steps):
            self.world.step(self.dt)
            if self.body.is_frozen:
                return
            calm = calm + 1 if not self.body.flipped_count() else 0
            if calm * self.dt >= CALM_TIME:
                break
        else:
            return
        crossing = self.size * math.sqrt(float(material.density) / float(material.young))
        self.body.set_gravity_scale(0.0)
        self.body.set_linear_damping(1.0 / crossing)
        for step in range(math.ceil(min(REST_CROSSINGS * crossing, LONGEST_REST) / self.dt)):
            self.world.step(self.dt)
            if self.body.is_frozen or (step > 30 and self.speed < REST_SPEED * self.size):
                return

    @property
    def speed(self) -> float:
        """Root mean square over mass [m/s]."""
        velocities, masses = self.body.velocities().astype(np.float64), self.body.masses
        return float(np.sqrt(masses @ (velocities**2).sum(axis=1) / masses.sum()))

    def ending(self, fastest: float, *, is_wrecked: bool) -> Ending:
        """What is to be judged."""
        body = self.body
        now = body.positions().astype(np.float64)
        is_finite = bool(np.isfinite(now).all())
        return Ending(
            tets=len(body.tets),
            failure=_failure_of(body) if body.is_frozen else None,
            is_finite=is_finite,
            flipped=body.flipped_count(),
            speed=self.speed if is_finite else math.inf,
            fastest=fastest,
            distance=distance_from_rest(self.rest, now, body.masses) if is_wrecked and is_finite else 0.0,
        )


def _failure_of(body: Body) -> str:
    failure = body.failure
    if failure is None or failure.tetrahedron is None:
        return "it cannot be told which tetrahedron broke first"
    mesh = body.mesh
    assert isinstance(mesh, TetMesh)
    angle = mesh.quality.min_dihedral[failure.tetrahedron]
    first = f"tetrahedron {failure.tetrahedron} (smallest angle {angle:.2g} degrees)"
    return f"at {failure.time:.2f} s, first {first}"
