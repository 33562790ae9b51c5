"""Settings of a world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.types import Integrator, Schedule


@dataclass(frozen=True, eq=False)
class Settings:
    """Checked arguments of a world, for which its kernels are compiled.

    `World.set_gravity` and `World.set_friction` replace them by a copy that differs only in that value.
    """

    gravity: NDArray[np.float64]  # (3,) [m/s^2], read-only
    floor: float | None  # height [m]
    restitution: float | None  # of the floor; None uses that of the bodies
    friction: float  # of the floor
    integrator: Integrator  # of all bodies
    tolerance: float  # of implicit solves: residual over load
    most_iterations: int  # of an implicit solve
    retries: int  # how often a failed step is retried, each time with twice the substeps
    schedule: Schedule  # as chosen by `World.build`; AUTO until then if not given


@dataclass(frozen=True)
class ContactSettings:
    """Contact and sleep settings."""

    soft: bool  # contact between soft bodies
    sleep_speed: float  # [m/s]; 0 turns sleep off
    collider_room: int  # number of colliders that can be added after `World.build`
    sample_room: int  # grid samples of these colliders
