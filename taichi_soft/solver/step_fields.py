"""Fields of the step: the state of each island, and the work that threads share."""

import numpy as np

from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import BODY, LOADED, WORLD, FieldGroup, declare
from taichi_soft.core.runtime import ti

MOST_PARTS = 16
"""Largest number of parts into which the bodies of an island are divided. If there are more threads than
parts, several threads begin with the same part."""


@ti.dataclass
class Progress:
    """State of an island within a step. Long steps are split over several kernel calls."""

    attempt: ti.i32  # number of the attempt at the step, from 0; or DONE
    s: ti.i32  # number of the next substep of the attempt
    is_stable: ti.i32  # 0 if forces changed a velocity by too much in a substep of the attempt
    failed: ti.i32  # number of failed bodies, valid after the step
    is_awake: ti.i32
    candidates: ti.i32  # state of the contact candidates: NONE, OUTDATED or VALID
    fastest: ti.f32  # highest speed in the last substep [m/s]
    velocity: ti.math.vec3  # mean velocity of the particles before the attempt [m/s]
    shift: ti.math.vec3  # displacement by `velocity` after the last search for candidates [m]


@ti.dataclass
class Moment:
    """Time and substep of an attempt at a step."""

    s: ti.i32  # number of the substep, from 0
    substeps: ti.i32  # number of substeps of the attempt
    is_last: ti.i32  # 1 in the last attempt
    h: ti.f32  # length of the substep [s]
    since: ti.f32  # time since the start of the step [s]
    left: ti.f32  # time until the end of the step [s]


@ti.dataclass
class Job:
    """Phase that runs separately for each body of an island, with the arguments of the phase."""

    phase: ti.i32
    s: ti.i32  # number of the substep, from 0
    substeps: ti.i32  # number of substeps of the attempt
    has_pairs: ti.i32  # 1 if bodies of the island can touch each other or themselves
    forgets: ti.i32  # 1 if the search for contacts must discard the old candidates
    h: ti.f32  # length of the substep [s]
    since: ti.f32  # time since the start of the step [s]
    left: ti.f32  # time until the end of the step [s]
    drift_time: ti.f32  # time for which the kick also moves particles [s]; 0: the drift moves them
    fastest: ti.f32  # highest speed in the island [m/s]
    impact_speed: ti.f32  # speed that an impact can give a body in this substep [m/s]
    velocity: ti.math.vec3  # mean velocity of the island, see `Progress` [m/s]
    shift: ti.math.vec3  # displacement of the island, see `Progress` [m]


class IslandFields(FieldGroup):
    """Islands, and the results of the last substep for each body."""

    owner, when = "solver", "has_contact"
    count = declare(WORLD, ti.i32, start=LOADED, native=True)
    first = declare(BODY, ti.i32, beyond=1, start=LOADED)  # first row of each island in `body`
    # All bodies, sorted by island. Bodies of one island can touch or are joined.
    body = declare(BODY, ti.i32, start=LOADED)
    of_body = declare(BODY, ti.i32, start=LOADED, keep=BODY)
    parent = declare(BODY, ti.i32)  # parent body in the forest of islands
    sweep_order = declare(BODY, ti.i32, start=LOADED)  # bodies, sorted by the lowest x of their boxes
    # Root mean square of the particle speeds at the start of the step, if bodies can sleep.
    mean_speed = declare(BODY, ti.f32, unit="m/s")
    is_exploding = declare(BODY, ti.i32)  # 1 if joints and searches ignore the body
    is_stable = declare(BODY, ti.i32)  # 0 if forces changed a velocity by too much
    has_failed = declare(BODY, ti.i32)  # 1 if the body failed, stays inverted or was solved inexactly
    body_speed = declare(BODY, ti.f32, unit="m/s")  # highest speed of a particle in this substep
    # Possible impact speeds of particles, relative to the mean velocity of the island. With explicit
    # integrators, the speed of a touched particle is its speed before the kick.
    body_speed_beside = declare(BODY, ti.f32, unit="m/s")  # highest speed of the body's particles
    body_mean_beside = declare(BODY, ti.f32, unit="m/s")  # root mean square speed of the body's particles

    def load(self, loader: Loader, bodies: int) -> None:
        """Give each body its own island."""
        loader.fill(self.count, np.array([bodies]))
        loader.fill(self.first, np.arange(bodies + 1))
        for rows in (self.body, self.of_body, self.sweep_order):
            loader.fill(rows, np.arange(bodies))


class JobFields(FieldGroup):
    """Fields for the work that threads share, see `kernels/jobs.py`."""

    owner, when = "solver", "has_contact"
    job = declare(BODY, Job, below={})  # current job of each island
    unfinished_islands = declare(WORLD, ti.i32)  # number of unfinished islands of several bodies
    useful_helpers = declare(WORLD, ti.i32)  # number of helpers for which there is work
    parts = declare(WORLD, ti.i32)  # number of parts into which an island's bodies are divided
    untaken = declare(BODY, ti.i32, each=MOST_PARTS)  # number of bodies that wait for a thread, by part
    unfinished = declare(BODY, ti.i32)  # number of bodies that have not finished the job, for each island
