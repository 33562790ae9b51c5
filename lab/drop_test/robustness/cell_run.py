"""Run one cell of the sweep: build the body, drop or release it, and judge the result."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lab.drop_test.robustness.cells import DAMPINGS, MESHES, Cell
from lab.drop_test.robustness.verdict import MOST_SUBSTEPS, Ending, Verdict, judge
from lab.drop_test.robustness.wrecks import distance_from_rest, wrecked
from taichi_soft import FrozenBodyWarning, Material, TetMesh, TooSoftWarning, World
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.world.bare import bare_world
from taichi_soft.world.body import Body

DROP, DROP_TIME = 2.0, 2.5
"""`DROP` is the height of the drop [m]. `DROP_TIME` is the simulated time [s]. It covers the fall of 0.64 s,
the impact, and the fall after a bounce."""

RECOVERY_TIME, CALM_TIME = 10.0, 0.5
"""`RECOVERY_TIME` is the time limit for the recovery of inverted tetrahedra [s]. A body has recovered when no
tetrahedron has been inverted for `CALM_TIME` [s]."""

REST_SPEED, LONGEST_REST = 1e-4, 60.0
"""A body is at rest if its speed (root mean square, weighted by mass) is below `REST_SPEED` [sizes of the
body per second]. After the recovery, gravity is switched off. The body must then come to rest within
`LONGEST_REST` [s], and within the time in which a wave crosses the body `REST_CROSSINGS` times."""

REST_CROSSINGS = 60.0

MOST_WORK = 2e9
"""Largest product of a cell's number of tetrahedra and its number of substeps. A cell with this product takes
about 30 s. Cells with a larger product count as too slow."""


def run_cell(cell: Cell) -> dict[str, Any]:
    """Run a cell. Returns: plain data with the verdict, its reason, and facts of the mesh and the step."""
    mesh = cell_mesh(cell["mesh"], cell["scale"])
    squared_sound = cell["young"] / cell["density"]
    facts = {
        "tets": len(mesh.tets),
        "min_dihedral": float(mesh.quality.min_dihedral.min()),  # [degrees]
        "substeps": None,  # number of substeps per 1/60 s
        "mach": math.sqrt(2 * GRAVITY_EARTH * DROP / squared_sound),  # impact speed / speed of sound
        "sag": GRAVITY_EARTH * float(np.ptp(mesh.vertices, axis=0).max()) / squared_sound,  # [body sizes]
    }
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            world, body = _build(cell, mesh)
            facts["substeps"] = world.stable_substeps(1 / 60)
        except TaichiSoftError as error:
            reason = f"{type(error).__name__}: {error}"
            return {**facts, "verdict": Verdict.REFUSED.value, "reason": reason}
    said = sorted({f"{each.category.__name__}: {each.message}" for each in caught})
    slow = _too_slow(cell, world, body)
    if slow is not None:
        reason = "; ".join([slow, *said]) if said else f"{slow}; nothing was said when it was built"
        return {**facts, "verdict": Verdict.TOO_SLOW.value, "reason": reason}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        verdict, reason = judge(_try(cell, world, body))
    told = next((str(each.message) for each in caught if each.category is TooSoftWarning), None)
    if verdict is Verdict.INVERTED and told is not None:
        verdict, reason = Verdict.TOO_SOFT, f"{reason}; when it was built: {told}"
    return {**facts, "verdict": verdict.value, "reason": reason}


@lru_cache(maxsize=128)
def cell_mesh(name: str, scale: float) -> TetMesh:
    """Return the mesh with this name, scaled."""
    mesh = MESHES[name]()
    return mesh if scale == 1.0 else TetMesh(mesh.vertices * scale, mesh.tets)


def _build(cell: Cell, mesh: TetMesh) -> tuple[World, Body]:
    """Build a world that contains only the body, above the floor."""
    damping = DAMPINGS[cell["damping"]](mesh, cell)
    material = Material(cell["young"], cell["poisson"], cell["density"], **damping)
    named = {option: cell[option] for option in ("law", "flips") if cell[option] is not None}
    world = bare_world()
    height = DROP + float(np.ptp(mesh.vertices, axis=0).max())
    body = world.add_body(mesh, material, position=(0.0, 0.0, height), **named)
    world.build()
    return world, body


def _too_slow(cell: Cell, world: World, body: Body) -> str | None:
    """Return the reason why the cell is too slow to run, or None."""
    substeps = world.stable_substeps(1 / 60)
    if substeps > MOST_SUBSTEPS:
        return f"{substeps} substeps for 1/60 s ({body.stable_step.stiffest})"
    steps = _steps(cell)
    work = steps * world.stable_substeps(cell["dt"]) * len(body.tets)
    return f"{work:.2g} substeps of tetrahedra in {steps} steps" if work > MOST_WORK else None


def _steps(cell: Cell) -> int:
    dt: float = cell["dt"]
    return round((DROP_TIME if cell["wreck"] is None else RECOVERY_TIME) / dt)


def _try(cell: Cell, world: World, body: Body) -> Ending:
    """Place the body at its start, run it, and return the measurements at the end."""
    x = body.mesh.vertices
    rest = x - (x.min(axis=0) + x.max(axis=0)) / 2
    size = float(np.ptp(rest, axis=0).max())
    is_wrecked = cell["wreck"] is not None
    start = wrecked(rest, cell["wreck"], cell["seed"]) if is_wrecked else rest
    gap = 0.1 * size if is_wrecked else DROP
    height = gap - float(min(rest[:, 2].min(), start[:, 2].min()))
    body.set_motion(start + np.array([0.0, 0.0, height]), np.zeros_like(start))
    run = _Run(world, body, rest, size, cell["dt"])
    if is_wrecked:
        run.recover(_steps(cell), size * math.sqrt(cell["density"] / cell["young"]))
    else:
        run.fall(_steps(cell))
    return run.ending(math.inf if is_wrecked else math.sqrt(2 * GRAVITY_EARTH * (height + size)))


@dataclass
class _Run:
    """A run of one cell."""

    world: World
    body: Body
    rest: np.ndarray[Any, np.dtype[np.float64]]
    size: float  # longest edge of the body's bounding box [m]
    dt: float  # length of a step [s]

    def fall(self, steps: int) -> None:
        """Simulate the fall for a number of steps."""
        for _ in range(steps):
            if self.body.is_frozen:
                return
            self.world.step(self.dt)

    def recover(self, steps: int, crossing: float) -> None:
        """Simulate until no tetrahedron is inverted, and then without gravity until the damped body rests.

        Args:
            steps: largest number of steps until all tetrahedra have recovered.
            crossing: time in which a wave crosses the body once [s].
        """
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
        self.body.set_gravity_scale(0.0)
        self.body.set_linear_damping(1.0 / crossing)
        for step in range(math.ceil(min(REST_CROSSINGS * crossing, LONGEST_REST) / self.dt)):
            self.world.step(self.dt)
            if self.body.is_frozen or (step > 30 and self.speed < REST_SPEED * self.size):
                return

    @property
    def speed(self) -> float:
        """Root mean square speed, weighted by mass [m/s]."""
        velocities, masses = self.body.velocities().astype(np.float64), self.body.masses
        return float(np.sqrt(masses @ (velocities**2).sum(axis=1) / masses.sum()))

    def ending(self, fastest: float) -> Ending:
        """Return the measurements.

        Args:
            fastest: largest speed during the fall [m/s]; infinite for a body that started strongly deformed.
        """
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
            distance=distance_from_rest(self.rest, now, body.masses)
            if is_finite and math.isinf(fastest)
            else 0.0,
        )


def _failure_of(body: Body) -> str:
    failure = body.failure
    if failure is None or failure.tetrahedron is None:
        return "the tetrahedron that failed first is unknown"
    mesh = body.mesh
    assert isinstance(mesh, TetMesh)
    angle = mesh.quality.min_dihedral[failure.tetrahedron]
    first = f"tetrahedron {failure.tetrahedron} (smallest angle {angle:.2g} degrees)"
    return f"at {failure.time:.2f} s, first {first}"
