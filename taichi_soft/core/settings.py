"""Settings of a world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.types import Integrator, Schedule


@dataclass(frozen=True, eq=False)
class Settings:
    """Checked arguments of a world. The kernels of the world are compiled for some of these arguments.

    `World.set_gravity` and `World.set_friction` replace the settings by a copy with the new value.
    """

    gravity: NDArray[np.float64]  # (3,) [m/s^2], read-only
    floor: float | None  # height of the floor [m]; None for no floor
    restitution: float | None  # restitution coefficient of the floor; None for the elasticity of the bodies
    friction: float  # friction coefficient of the floor
    integrator: Integrator  # integrator of all bodies
    tolerance: float  # an implicit solve ends when its residual is below this fraction of the load
    most_iterations: int  # largest number of iterations of an implicit solve
    retries: int  # largest number of retries of a failed step; each retry doubles the number of substeps
    schedule: Schedule  # argument of `World`; after `World.build`, the schedule that it chose


DEFAULT_SLEEP_SPEED = 0.02
"""Default `sleep_speed` [m/s], within the range of rigid-body engines: 0.01 m/s to 0.05 m/s (Box2D, Jolt).

At this speed, a body of 0.1 m to 10 m can stop without a visible jump: it moves a third of a millimetre
between two frames. With a lower value, bodies would tremble longer before they fall asleep."""

DEFAULT_COLLIDER_ROOM = 15
"""Default `collider_room`. Worlds round the number of rows up to a power of two. These colliders and the
floor fill 16 rows, so no row is unused."""


@dataclass(frozen=True)
class ContactSettings:
    """Contact and sleep settings."""

    soft: bool  # True if soft bodies can touch each other
    sleep_speed: float  # speed below which bodies fall asleep [m/s]; 0 turns sleep off
    collider_room: int  # number of colliders that can be added after `World.build`
    sample_room: int  # number of grid samples reserved for colliders that are added after `World.build`


@dataclass(frozen=True)
class ContactRequest:
    """Contact and sleep arguments of `World`. None means the default."""

    soft: bool | None
    sleep_speed: float | None
    collider_room: int | None
    sample_room: int

    def settings(self, *, can_touch: bool, is_flat: bool) -> ContactSettings:
        """Return the settings, with each None replaced by its default.

        Args:
            can_touch: True if bodies, or parts of one body, can touch each other. If False, contact between
                bodies is off by default, because compiling it takes time.
            is_flat: True for the schedule "flat", which supports neither contact nor sleep.
        """
        defaults = (False, 0.0, 0) if is_flat else (can_touch, DEFAULT_SLEEP_SPEED, DEFAULT_COLLIDER_ROOM)
        soft, sleep_speed, collider_room = defaults
        return ContactSettings(
            soft if self.soft is None else self.soft,
            sleep_speed if self.sleep_speed is None else self.sleep_speed,
            collider_room if self.collider_room is None else self.collider_room,
            self.sample_room,
        )
