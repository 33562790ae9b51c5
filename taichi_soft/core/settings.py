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
    friction: float  # coefficient of the floor
    integrator: Integrator  # of all bodies
    tolerance: float  # of implicit solves: residual over load
    most_iterations: int  # of an implicit solve
    retries: int  # maximum retries of a failed step, each with twice the substeps
    schedule: Schedule  # as chosen by `World.build`; AUTO until then if not given


DEFAULT_SLEEP_SPEED = 0.02
"""Default `sleep_speed` [m/s], within the 0.01 to 0.05 m/s of engines of rigid bodies (Box2D, Jolt).

At this speed, a body of 0.1 m to 10 m can stop without a visible jump: it moves a third of a millimetre
between two frames. With a lower value, bodies would tremble longer before they fall asleep."""

DEFAULT_COLLIDER_ROOM = 15
"""Default `collider_room`: 16 rows with the floor. The number of rows is rounded up to a power of two."""


@dataclass(frozen=True)
class ContactSettings:
    """Contact and sleep settings."""

    soft: bool  # contact between soft bodies
    sleep_speed: float  # [m/s]; 0 turns sleep off
    collider_room: int  # number of colliders that can be added after `World.build`
    sample_room: int  # grid samples of these colliders


@dataclass(frozen=True)
class ContactRequest:
    """Contact and sleep arguments of `World`; None for the default."""

    soft: bool | None
    sleep_speed: float | None
    collider_room: int | None
    sample_room: int

    def settings(self, *, can_touch: bool, is_flat: bool) -> ContactSettings:
        """Replace each None by its default.

        Args:
            can_touch: True if bodies, or parts of one body, can touch each other. If not, contact between
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
