"""Whether a budget of milliseconds is kept: by bodies that take twice as long as they may."""

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
"""Of as many bodies each."""

SPACING = 1.6
"""Of bodies of a metre at most [m]: they do not touch each other, see docs/speed.md."""

SETTLING = 60
"""Frames in which they come down."""

SHARE = 0.5
"""The budget, of the median step without one."""

EYE = (-8.0, 0.0, 2.0)  # [m]

IN_TURN = 10
"""Steps of which the first and the median fit a budget that is met."""


@dataclass(frozen=True)
class KeptBudget:
    """Steps of the same bodies, without a budget or with one."""

    budget: float  # [ms]; the steps without one are held against it, too
    is_kept: bool  # whether there was a budget to keep
    is_fixed: bool  # whether levels were those of such a run's end, from the beginning
    step: Spread  # [ms]: `World.step`
    work: Spread  # [ms]: what the processors worked on it, without waiting for other programs
    settled: Spread  # [ms]: the same, from when the budget was met, or of all steps
    frame: Spread  # [ms]: `EngineAdapter.step`, with what deciding takes and changes of level
    late: float  # part of all steps that took longer than the budget
    late_settled: float  # the same, from when the budget was met, or of all steps
    met_after: int | None  # steps; None where it was never met
    deciding: Spread | None  # [ms]: all of a frame but its step, in frames without a change
    changing: Spread | None  # [ms]: the same, in frames with changes; None where there were none
    frames_with_changes: int
    skipped: float  # part of all steps of all bodies that they stood still in
    levels: dict[int, int]  # bodies at each level, in the end
    levels_in_order: tuple[int, ...]  # of each body
    tets: int  # in the end
    frozen: int  # bodies that went non-finite
    stolen: float | None  # part of the processors' time that the host gave to other machines


def measure_kept_budget(steps: int = 600) -> list[KeptBudget]:
    """Measure bodies without a budget, and the same with half of what their median step took. Then again
    without one, at the levels that they had in the end: what then is longer than the median is the machine.

    One after the other, as a game has one world. Nobody sleeps, or there would be nothing to save.
    """
    kinds = _kinds()
    levels = (0,) * ROWS**2
    free = _measure(kinds, steps, None, levels)
    kept = _measure(kinds, steps, free.budget, levels)
    return [free, kept, _measure(kinds, steps, free.budget, kept.levels_in_order, is_fixed=True)]


def _kinds() -> list[SoftBodyAsset]:
    """Balls, rings and capsules, of three levels of detail each."""
    material = Material(2e5, 0.4, 1000.0)
    surfaces = (
        trimesh.creation.icosphere(subdivisions=3, radius=0.4),
        trimesh.creation.torus(0.35, 0.15),
        trimesh.creation.capsule(height=0.5, radius=0.25),
    )
    return [SoftBodyAsset.from_surface(surface, material, cells=CELLS) for surface in surfaces]


def _toys(kinds: list[SoftBodyAsset], levels: Sequence[int]) -> _TimedWorld:
    """Side by side on the floor, where they were let fall, and then changed to `levels`."""
    world = _TimedWorld(soft_contact=True, sleep_speed=0.0)
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
    """Knows what each of its steps took."""

    def __init__(self, **options: Any) -> None:
        """As a World."""
        super().__init__(**options)
        self.took: list[float] = []  # [ms]
        self.work: list[float] = []  # [ms]: of the processors
        self.skipped = 0

    def step(self, dt: float, substeps: int | None = None) -> None:
        """As a World."""
        start, work = perf_counter(), process_time()
        super().step(dt, substeps)
        self.took.append(1e3 * (perf_counter() - start))
        self.work.append(1e3 * (process_time() - work))

    def skip_step(self, bodies: Sequence[Body]) -> None:
        """As a World."""
        self.skipped += len(bodies)
        super().skip_step(bodies)


@dataclass
class Course:
    """What happened in a run, step by step."""

    steps: list[float]  # what each took [ms]
    frames: list[float]  # the same, of whole frames
    levels: list[tuple[int, ...]]  # of all bodies: before the first step, and after each


def first_met(steps: list[float], limit: float) -> int | None:
    """Steps before the first that fits with the median of `IN_TURN` from there on; None where none does."""
    for i in range(len(steps) - IN_TURN + 1):
        if steps[i] <= limit and np.median(steps[i : i + IN_TURN]) <= limit:
            return i
    return None


def tell(course: Course, limit: float, **facts: Any) -> KeptBudget:
    """What steps and frames of a run took.

    Args: limit: the budget [ms]. facts: the rest of a KeptBudget, as it is.
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
