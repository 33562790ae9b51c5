"""What holds for all bodies of a world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.types import Integrator, Schedule


@dataclass(frozen=True, eq=False)
class Settings:
    """The checked arguments of a world: its kernels are compiled for them.

    `World.set_gravity` and `World.set_friction` give the world others, where nothing else differs.
    """

    gravity: NDArray[np.float64]  # (3,) [m/s^2], read-only
    floor: float | None  # height [m]
    restitution: float | None  # of the floor; None for that of the bodies
    friction: float  # of the floor
    integrator: Integrator  # of all bodies
    tolerance: float  # of implicit solves: residual over load
    most_iterations: int  # of an implicit solve
    retries: int  # how often a step that fails is made again, twice as fine each time
    schedule: Schedule  # as chosen by `World.build`; AUTO before where it is left open


@dataclass(frozen=True)
class ContactSettings:
    """What bodies may meet beside a floor, and how they come to rest."""

    soft: bool  # each other
    sleep_speed: float  # [m/s]; 0 for never
    collider_room: int  # colliders that may come after `World.build`
    sample_room: int  # values in their grids
