"""Measure whether a time budget reduces the detail of bodies until their steps fit the budget.

Without a budget, the bodies need twice the time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter, process_time
from typing import Any

import numpy as np
import trimesh

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft.bodies.asset import SoftBodyAsset
from taichi_soft.elements.materials import Material
from taichi_soft.profiling.spread import Spread
from taichi_soft.profiling.stolen import processor_ticks, stolen_since
from taichi_soft.world.body import Body
from taichi_soft.world.world import World

DT = 1 / 60
CELLS = (10, 7, 5)
ROWS = 5
"""Number of rows of bodies."""

SPACING = 1.6
"""Distance between the centres of bodies [m]. The bodies are at most 1 m wide and do not touch, see
docs/speed.md."""

SETTLING = 60
"""Number of frames after which all bodies have landed."""

SHARE = 0.5
"""Budget as a fraction of the median step time without a budget."""

EYE = (-8.0, 0.0, 2.0)  # [m]

IN_TURN = 10
"""Number of consecutive steps whose median must fit the budget. The budget counts as met at the first such
step that also fits the budget."""


@dataclass(frozen=True)
class KeptBudget:
    """Times of one of the runs, see `measure_kept_budget`."""

    budget: float  # budget [ms]; a run without a budget uses it only for comparison
    is_kept: bool  # True if the run had a budget
    is_fixed: bool  # True if the levels were fixed to the final levels of the run with a budget
    step: Spread  # time of `World.step` [ms]
    work: Spread  # CPU time of a step [ms], without waiting for other programs
    settled: Spread  # time of the steps after the budget was met, or of all steps if it was never met [ms]
    frame: Spread  # time of `EngineAdapter.step` [ms], including decisions and changes of level
    late: float  # fraction of steps longer than the budget
    late_settled: float  # fraction of late steps in `settled`
    met_after: int | None  # steps until the budget was met; None if it was never met
    deciding: Spread | None  # `frame` minus `step` in frames without a change of level [ms]
    changing: Spread | None  # `frame` minus `step` in frames with a change of level [ms], if any
    frames_with_changes: int
    skipped: float  # fraction of the bodies' steps that were skipped
    levels: dict[int, int]  # number of bodies by final level
    levels_in_order: tuple[int, ...]  # final level of each body
    tets: int  # number of tetrahedra at the end
    frozen: int  # number of bodies that became non-finite
    stolen: float | None  # fraction of the CPU time that the host gave to other machines


def measure_kept_budget(steps: int = 600) -> list[KeptBudget]:
    """Make three runs: without a budget, with a budget of half the median step, and at the final levels of
    the second run.

    The third run has no budget, so its long steps are caused by other programs on the machine. The runs are
    consecutive, because a game has one world. Sleep is off, so that there is work to reduce.
    """
    kinds = _kinds()
    levels = (0,) * ROWS**2
    free = _measure(kinds, steps, None, levels)
    kept = _measure(kinds, steps, free.budget, levels)
    return [free, kept, _measure(kinds, steps, free.budget, kept.levels_in_order, is_fixed=True)]


def _kinds() -> list[SoftBodyAsset]:
    """Make balls, rings and capsules, with three levels of detail each."""
    material = Material(2e5, 0.4, 1000.0)
    surfaces = (
        trimesh.creation.icosphere(subdivisions=3, radius=0.4),
        trimesh.creation.torus(0.35, 0.15),
        trimesh.creation.capsule(height=0.5, radius=0.25),
    )
    return [SoftBodyAsset.from_surface(surface, material, cells=CELLS) for surface in surfaces]


def _toys(kinds: list[SoftBodyAsset], levels: Sequence[int]) -> _TimedWorld:
    """Drop bodies onto the floor, apart from each other, and then set them to `levels`."""
    world = _TimedWorld(soft_contact=True, sleep_speed=0.0, collider_room=0)
    for kind in kinds:
        world.reserve(kind, -(-(ROWS**2) // len(kinds)))
    for i in range(ROWS**2):
        across = np.array([i % ROWS, i // ROWS, 0.0]) - 0.5 * np.array([ROWS - 1, ROWS - 1, 0])
        place = SPACING * across + (0.0, 0.0, 0.6)
        world.spawn(kinds[i % len(kinds)], position=place)
    world.build()
    world.warm_up()
    for _ in range(SETTLING):
        world.step(DT)
    for body, level in zip(world.bodies, levels, strict=True):
        body.set_level(level)
    return world


class _TimedWorld(World):
    """A world that records the time of each step."""

    def __init__(self, **options: Any) -> None:
        """Make a world with the options of `World`."""
        super().__init__(**options)
        self.took: list[float] = []  # step times [ms]
        self.work: list[float] = []  # CPU times [ms]
        self.skipped = 0

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make a step, see `World.step`, and record its time."""
        start, work = perf_counter(), process_time()
        super().step(dt, substeps)
        self.took.append(1e3 * (perf_counter() - start))
        self.work.append(1e3 * (process_time() - work))

    def skip_step(self, bodies: Sequence[Body]) -> None:
        """Skip the next step of bodies, see `World.skip_step`."""
        self.skipped += len(bodies)
        super().skip_step(bodies)


@dataclass
class Course:
    """Times and levels of a run, for each step."""

    steps: list[float]  # step times [ms]
    frames: list[float]  # frame times [ms]
    levels: list[tuple[int, ...]]  # levels of all bodies before the first step and after each step


def first_met(steps: list[float], limit: float) -> int | None:
    """Return the number of steps before the budget is met, see `IN_TURN`; None if it is never met."""
    for i in range(len(steps) - IN_TURN + 1):
        if steps[i] <= limit and np.median(steps[i : i + IN_TURN]) <= limit:
            return i
    return None


def tell(course: Course, limit: float, **facts: Any) -> KeptBudget:
    """Summarise the steps and frames of a run.

    Args: limit: budget [ms]. facts: remaining fields of the KeptBudget.
    """
    rest = [frame - step for frame, step in zip(course.frames, course.steps, strict=True)]
    changed = [one != other for one, other in pairwise(course.levels)]
    calm = [each for each, is_changed in zip(rest, changed, strict=True) if not is_changed]
    changing = [each for each, is_changed in zip(rest, changed, strict=True) if is_changed]
    met_after = first_met(course.steps, limit)
    settled = course.steps[met_after or 0 :]
    return KeptBudget(
        budget=limit,
        step=Spread.of(course.steps),
        settled=Spread.of(settled),
        frame=Spread.of(course.frames),
        late=_late(course.steps, limit),
        late_settled=_late(settled, limit),
        met_after=met_after,
        deciding=Spread.of(calm) if calm else None,
        changing=Spread.of(changing) if changing else None,
        frames_with_changes=len(changing),
        levels=dict(sorted(Counter(course.levels[-1]).items())),
        levels_in_order=course.levels[-1],
        **facts,
    )


def _late(steps: list[float], limit: float) -> float:
    return sum(step > limit for step in steps) / len(steps)


def _measure(
    kinds: list[SoftBodyAsset],
    steps: int,
    budget: float | None,
    levels: Sequence[int],
    *,
    is_fixed: bool = False,
) -> KeptBudget:
    is_kept = budget is not None and not is_fixed
    world = _toys(kinds, levels)
    game = EngineAdapter(world, FixedStep(dt=DT), budget_ms=budget if is_kept else None)
    if is_kept:
        game.see_from(EYE)
    world.took.clear()
    world.work.clear()
    course = Course(world.took, [], [_levels(world)])
    before = processor_ticks()
    for _ in range(steps):
        start = perf_counter()
        game.step()
        course.frames.append(1e3 * (perf_counter() - start))
        course.levels.append(_levels(world))
    stolen = stolen_since(before)
    return tell(
        course,
        SHARE * float(np.median(world.took)) if budget is None else budget,
        is_kept=is_kept,
        is_fixed=is_fixed,
        work=Spread.of(world.work),
        skipped=world.skipped / (steps * len(world.bodies)),
        tets=sum(len(body.tets) for body in world.bodies),
        frozen=sum(body.is_frozen for body in world.bodies),
        stolen=stolen,
    )


def _levels(world: World) -> tuple[int, ...]:
    return tuple(body.level for body in world.bodies)
