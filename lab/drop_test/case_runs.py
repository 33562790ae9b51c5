"""Run many cases in one world. Each body has a separate collision group and touches only its own course."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lab.drop_test.case import LARGEST, SHAPES, STEPS_PER_SECOND, Case, shape_mesh
from lab.drop_test.outcome import Outcome
from taichi_soft import Contact, FrozenBodyWarning, HeightFieldShape, Material, SoftBodyAsset, World
from taichi_soft.core.types import FlipsName, LawName
from taichi_soft.world.bare import bare_world
from taichi_soft.world.body import Body

Floats = NDArray[np.float64]

PER_SHAPE = 6
"""Largest number of cases of each shape in one world. Each case occupies one collision group."""

MOST_COLLIDERS, MOST_SAMPLES = 512, 1 << 20
"""Capacities of each world: number of colliders, and number of height samples. The capacities are equal in
all worlds, so that the worlds share compiled kernels."""

CALM_SPEED, LEAST_CALM_SPEED, CALM_TIME = 0.01, 0.005, 0.5
"""A body is at rest if the root mean square of its vertices' speeds stays below a limit for `CALM_TIME` [s].
The limit is the larger of `CALM_SPEED` [sizes of the body per second] and `LEAST_CALM_SPEED` [m/s].
`LEAST_CALM_SPEED` is half of Box2D's sleeping threshold. Small balls need it, because in a corner they keep
rocking from facet to facet at a few mm/s."""

PATIENCE = 150.0
"""Time within which a body must come to rest [`Case.unit_time`]."""

FREE_TIME, BRAKE = 20.0, 0.2
"""After `FREE_TIME` [`Case.unit_time`], all velocities are damped at the rate `BRAKE` [1 / `Case.unit_time`].
Without this damping, a stiff ball would roll on a plane for minutes. Bodies that gain energy or slide down a
slope keep moving despite the damping."""


def run_cases(cases: Iterable[Case]) -> Iterator[Outcome]:
    """Run all cases, and yield the outcome of each case when it ends."""
    for batch in batches(list(cases)):
        yield from _run_batch(batch)


def batches(cases: list[Case]) -> Iterator[list[Case]]:
    """Yield batches of cases that fit into one world.

    The cases of a batch have the same law and number of substeps, and at most `PER_SHAPE` of them have the
    same shape.
    """
    for kind in sorted({(case.law, case.substeps) for case in cases}):
        alike = [case for case in cases if (case.law, case.substeps) == kind]
        queues = [[case for case in alike if case.shape == shape] for shape in SHAPES]
        while any(queues):
            yield [queue.pop(0) for queue in queues for _ in range(min(PER_SHAPE, len(queue)))]


class _Run:
    """The body of one case, and its measurements."""

    def __init__(self, case: Case, body: Body) -> None:
        self.case, self.body = case, body
        self.outer = np.unique(case.mesh.surface)
        self.before = body.positions()
        self.out, self.out_through = -np.inf, None  # type: float, str | None
        self.calm = 0  # number of steps since the body last moved fast
        self.speed = np.inf

    def measure_step(self) -> None:
        """Update the measurements after a step."""
        now = self.body.positions()
        paths = np.linalg.norm(now - self.before, axis=1).astype(np.float64)
        self.speed = float(np.sqrt((paths**2).mean())) * STEPS_PER_SECOND / self.case.size
        is_calm = self.speed < max(CALM_SPEED, LEAST_CALM_SPEED / self.case.size)
        self.calm = self.calm + 1 if is_calm else 0
        self.before = now
        outer = now[self.outer].astype(np.float64)
        for solid in self.case.course:
            if solid.is_room:
                depth = solid.depth(outer)
                if depth > self.out:
                    self.out = depth
                    self.out_through = solid.name if depth > solid.tolerance else None

    @property
    def is_at_rest(self) -> bool:
        """True if the body has been slow for `CALM_TIME`."""
        return self.calm >= CALM_TIME * STEPS_PER_SECOND and not self.body.is_frozen

    def outcome(self, time: float, *, is_at_rest: bool) -> Outcome:
        """Return the outcome at world time `time` [s]."""
        outer = self.before[self.outer].astype(np.float64)
        depths = [(solid.depth(outer), solid) for solid in self.case.course if not solid.is_room]
        worst, deepest = max(((d - s.tolerance, d), s.name) for d, s in depths)
        return Outcome(
            self.case,
            time if self.body.is_frozen else None,
            self.out,
            self.out_through,
            worst[1],
            deepest if worst[0] > 0 else None,
            time if is_at_rest else None,
            self.speed,
            self.body.flipped_count(),
        )


def _run_batch(batch: list[Case]) -> Iterator[Outcome]:
    world, runs = _world_of(batch)
    count = batch[0].substeps
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrozenBodyWarning)
        while runs:
            for run in runs:
                if world.step_count == round(FREE_TIME * run.case.unit_time * STEPS_PER_SECOND):
                    run.body.set_linear_damping(BRAKE / run.case.unit_time)
            world.step(1 / STEPS_PER_SECOND, count)
            for run in list(runs):
                run.measure_step()
                is_at_rest = run.is_at_rest
                if is_at_rest or run.body.is_frozen or world.time >= PATIENCE * run.case.unit_time:
                    yield run.outcome(world.time, is_at_rest=is_at_rest)
                    world.despawn(run.body)
                    runs.remove(run)


def _world_of(batch: list[Case]) -> tuple[World, list[_Run]]:
    """Build a world with the cases of a batch. All worlds have the same capacity."""
    world = bare_world(floor=None, collider_room=MOST_COLLIDERS - 1 - sum(len(case.course) for case in batch))
    samples = 0
    bodies = []
    for bit, case in enumerate(batch):
        contact = Contact(group=1 << bit, mask=1 << bit)
        asset = SoftBodyAsset(case.mesh, case.material, law=case.law, flips=case.flips, contact=contact)
        world.reserve(asset, 1)
        bodies.append(
            world.spawn(
                asset,
                position=case.position,
                rotation=case.rotation,
                velocity=case.velocity,
                angular_velocity=case.angular_velocity,
            )
        )
        for solid in case.course:
            samples += len(solid.shape.samples)
            world.add_collider(
                solid.shape,
                position=solid.position,
                rotation=solid.rotation,
                friction=solid.friction,
                restitution=solid.restitution,
                group=contact.group,
                mask=contact.mask,
            )
    # All worlds must have the same number of height samples. This collider adds the missing samples, and
    # nothing can touch it.
    world.add_collider(HeightFieldShape(np.zeros((2, (MOST_SAMPLES - samples) // 2)), 1.0), group=0, mask=0)
    for shape in SHAPES:
        missing = PER_SHAPE - sum(case.shape == shape for case in batch)
        if missing:
            world.reserve(_filler(shape, batch[0].law, batch[0].flips), missing)
    world.build()
    return world, [_Run(case, body) for case, body in zip(batch, bodies, strict=True)]


@cache
def _filler(shape: str, law: LawName, flips: FlipsName | None) -> SoftBodyAsset:
    """Make the asset for slots that no case uses. It is soft and pinned, so that it causes no warnings."""
    mesh = shape_mesh(shape, LARGEST, np.full(2, 0.5))
    pinned = range(len(mesh.vertices))
    return SoftBodyAsset(mesh, Material(1.0, 0.3, 1000.0, 0.0), law=law, flips=flips, pinned=pinned)
