"""Fields of the step: how far each island has come in it, and what threads have to know of each other."""

import numpy as np

from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import BODY, LOADED, WORLD, FieldGroup, declare
from taichi_soft.core.runtime import ti

MOST_PARTS = 16
"""Parts of an island's bodies: threads beyond these share theirs."""


@ti.dataclass
class Progress:
    """How far an island has come in a step, which a long one is made of several calls for."""

    attempt: ti.i32  # number of the attempt at the step, from 0; or DONE
    s: ti.i32  # next substep of the attempt
    is_stable: ti.i32  # 0 where forces changed a velocity by too much at once in the attempt
    failed: ti.i32  # bodies that did, once the step is made
    is_awake: ti.i32
    candidates: ti.i32  # NONE, OUTDATED or VALID
    fastest: ti.f32  # highest speed in the last substep [m/s]
    velocity: ti.math.vec3  # mean velocity of the particles before the attempt [m/s]
    shift: ti.math.vec3  # way with that velocity since candidates were searched for [m]


@ti.dataclass
class Moment:
    """Where an attempt at a step is."""

    s: ti.i32  # number of the substep, from 0
    substeps: ti.i32  # of the attempt
    is_last: ti.i32  # 1 in the last attempt
    h: ti.f32  # length of the substep [s]
    since: ti.f32  # time since the start of the step, and until its end [s]
    left: ti.f32


@ti.dataclass
class Job:
    """A phase that each body of an island makes by itself, and what it has to know."""

    phase: ti.i32
    s: ti.i32  # number of the substep, from 0
    substeps: ti.i32  # of the attempt at a step
    has_pairs: ti.i32  # 1 where bodies of the island may touch each other, or themselves
    forgets: ti.i32  # 1 where a search drops the candidates there are
    h: ti.f32  # length of the substep [s]
    since: ti.f32  # time since the start of the step, and until its end [s]
    left: ti.f32
    drift_time: ti.f32  # for how long particles drift with the kick already [s]
    fastest: ti.f32  # highest speed in the island [m/s]
    impact_speed: ti.f32  # that a body may get within the substep from others [m/s]
    velocity: ti.math.vec3  # as in `Progress`
    shift: ti.math.vec3


class IslandFields(FieldGroup):
    """Islands, and what their bodies tell each other in a substep."""

    owner, when = "solver", "has_contact"
    count = declare(WORLD, ti.i32, start=LOADED, native=True)
    first = declare(BODY, ti.i32, beyond=1, start=LOADED)  # row of its first body
    body = declare(BODY, ti.i32, start=LOADED)  # bodies that may touch or are joined, by island
    of_body = declare(BODY, ti.i32, start=LOADED, keep=BODY)
    parent = declare(BODY, ti.i32)  # in the forest of islands
    sweep_order = declare(BODY, ti.i32, start=LOADED)  # bodies by their lower x
    rest_state = declare(BODY, ti.i32)  # MOVING, SLOW or RESTING of `vibration`
    is_exploding = declare(BODY, ti.i32)  # 1 if it must not take others with it
    is_stable = declare(BODY, ti.i32)  # 0 if forces changed a velocity by too much
    has_failed = declare(BODY, ti.i32)  # 1 if it broke or was not solved well in this step
    body_speed = declare(BODY, ti.f32, unit="m/s")  # of its fastest particle in this substep
    # Relative to the velocity that its island shares; with leapfrog of what was touched before the push.
    body_speed_beside = declare(BODY, ti.f32, unit="m/s")  # of its fastest particle
    body_mean_beside = declare(BODY, ti.f32, unit="m/s")  # root mean square over particles

    def load(self, loader: Loader, bodies: int) -> None:
        """Give each body an island of its own."""
        loader.fill(self.count, np.array([bodies]))
        loader.fill(self.first, np.arange(bodies + 1))
        for rows in (self.body, self.of_body, self.sweep_order):
            loader.fill(rows, np.arange(bodies))


class JobFields(FieldGroup):
    """What threads share islands by: see `kernels/jobs.py`."""

    owner, when = "solver", "has_contact"
    job = declare(BODY, Job, below={})  # of each island, what is called for
    unfinished_islands = declare(WORLD, ti.i32)  # of several bodies
    useful_helpers = declare(WORLD, ti.i32)  # threads beside their owners that could find a body there
    parts = declare(WORLD, ti.i32)  # of the bodies of an island, one for each thread
    untaken = declare(BODY, ti.i32, each=MOST_PARTS)  # bodies of each part that wait for a thread
    unfinished = declare(BODY, ti.i32)  # bodies of each island whose phase is not done yet
