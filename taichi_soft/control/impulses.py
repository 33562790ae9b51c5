"""Impulses: instantaneous changes of momentum. Velocities change at once, positions in the next step.

Pinned particles do not move, because their constraint absorbs their part of an impulse.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.bodies.soft_body import Context, SoftBody
from taichi_soft.control.change import (
    attempt,
    change,
    mark_modified,
    mass_of,
    numbers,
    rows_of,
    some_particles,
)
from taichi_soft.control.kernels.impulses import add_impulse_near, add_radial_impulse, add_velocity
from taichi_soft.core.checks import as_number, as_vector
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError

LARGEST_IMPULSE = 1e20
"""Limit of impulses [N s] and of forces [N]. Calls with larger values are rejected."""


def apply_impulse(body: SoftBody, impulse: ArrayLike, particles: ArrayLike | None) -> None:
    """Implement `Body.apply_impulse`."""
    momentum = as_vector(impulse, "impulse", "N s", LARGEST_IMPULSE)
    vertices = some_particles(body, particles)
    velocity = momentum / mass_of(body, vertices)
    _require_speed(float(np.linalg.norm(velocity)), "impulse")
    change(body, add_velocity, rows_of(body, vertices), numbers(velocity))


def apply_impulse_at_point(body: SoftBody, impulse: ArrayLike, point: ArrayLike, radius: float) -> None:
    """Implement `Body.apply_impulse_at_point`."""
    momentum = as_vector(impulse, "impulse", "N s", LARGEST_IMPULSE)
    center = as_vector(point, "point", "m")
    reach = as_number(radius, "radius", 1e-9, 1e9, "a number above 0 m, from 1e-9 to 1e9")
    found = np.empty(2)
    attempt(body, add_impulse_near, body.index, numbers(center, reach, momentum), found)
    nearest, speed = found.tolist()
    _require_speed(speed, "impulse")
    if nearest >= reach:
        raise OptionError(
            f"point {center.tolist()} is {nearest:.4g} m from the nearest particle of body {body.index}, "
            f"beyond radius={reach:g} m: move the point to the body, or increase the radius"
        )
    mark_modified(body)


def apply_radial_impulse(context: Context, center: ArrayLike, impulse: float, radius: float) -> None:
    """Implement `World.apply_radial_impulse`."""
    origin = as_vector(center, "center", "m")
    momentum = as_number(impulse, "impulse", -LARGEST_IMPULSE, LARGEST_IMPULSE)
    reach = as_number(radius, "radius", 1e-9, 1e9, "a number above 0 m, from 1e-9 to 1e9")
    row, found = numbers(origin, reach, momentum), np.empty(1, dtype=np.float32)
    context.built.attempt(add_radial_impulse, len(context.slots.slots), row, found)
    _require_speed(float(found[0]), "impulse")
    context.built.mark_changed()
    context.built.wake_near(origin - reach, origin + reach)


def _require_speed(speed: float, name: str) -> None:
    if not speed < VELOCITY_LIMIT:
        raise OptionError(
            f"{name} would change velocities by {speed:.4g} m/s: stay below {VELOCITY_LIMIT:g} m/s"
        )
