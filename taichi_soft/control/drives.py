"""External forces, gravity, linear damping and wind. They act during the steps that follow."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import Context, SoftBody, context_of
from taichi_soft.control.change import change, mass_of, numbers, require_per_body, rows_of, some_particles
from taichi_soft.control.impulses import LARGEST_IMPULSE
from taichi_soft.control.kernels.drives import (
    add_push,
    add_pushes,
    write_gravity_scale,
    write_linear_damping,
    write_shelter,
    write_wind,
)
from taichi_soft.core.checks import as_array, as_flag, as_gravity, as_number, as_vector
from taichi_soft.core.constants import VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError

ForceField = Callable[[NDArray[np.float32], float], ArrayLike]
"""Function that returns accelerations, (n, 3) [m/s^2], for positions (n, 3) [m] and a time [s]."""

MAX_ACCELERATION = 1e9
"""Largest acceleration that `apply_force` accepts [m/s^2]. At this acceleration, a vertex reaches the highest
valid velocity within 20 us."""


def apply_force(body: SoftBody, force: ArrayLike, particles: ArrayLike | None) -> None:
    """Implement `Body.apply_force`."""
    total = as_vector(force, "force", "N", LARGEST_IMPULSE)
    vertices = some_particles(body, particles)
    acceleration = total / mass_of(body, vertices)
    if not np.abs(acceleration).max() < MAX_ACCELERATION:
        raise OptionError(
            f"force would accelerate vertices by {np.abs(acceleration).max():.4g} m/s^2: "
            f"stay below {MAX_ACCELERATION:g} m/s^2"
        )
    require_per_body(context_of(body), "forces")
    change(body, add_push, body.index, rows_of(body, vertices), numbers(acceleration))


def set_gravity(context: Context, gravity: ArrayLike) -> None:
    """Implement `World.set_gravity`."""
    acceleration = as_gravity(gravity)
    if (acceleration != context.settings.gravity).any():
        context.apply_settings(replace(context.settings, gravity=acceleration))
        if context.fields is not None:
            context.fields.mark_modified(-1)


def set_gravity_scale(body: SoftBody, scale: float) -> None:
    """Implement `Body.set_gravity_scale`."""
    change(body, write_gravity_scale, body.index, as_number(scale, "scale", -1e3, 1e3))


def set_linear_damping(body: SoftBody, rate: float) -> None:
    """Implement `Body.set_linear_damping`."""
    per_second = as_number(rate, "rate", 0.0, 1e6, "a number from 0 to 1e6 per second")
    require_per_body(context_of(body), "linear damping")
    change(body, write_linear_damping, body.index, per_second)


def set_sheltered(body: SoftBody, is_sheltered: bool) -> None:
    """Implement `Body.set_sheltered`."""
    change(body, write_shelter, body.index, int(as_flag(is_sheltered, "is_sheltered")))


def set_wind(context: Context, velocity: ArrayLike | None, density: float, drag: float) -> None:
    """Implement `World.set_wind`."""
    blows = velocity is not None
    speed = as_vector(velocity if blows else (0, 0, 0), "velocity", "m/s", VELOCITY_LIMIT)  # type: ignore[arg-type]
    kilograms = as_number(density, "density", 0.0, 1e5, "a number from 0 to 100,000 kg/m^3")
    coefficient = as_number(drag, "drag", 0.0, 1e3)
    require_per_body(context, "wind")
    if context.built.attempt(write_wind, numbers(speed, kilograms * coefficient * blows)):
        context.built.mark_modified(-1)


def require_field(field: Any) -> ForceField | None:
    """Check that `field` is a function or None, and return it. Raises: OptionError."""
    if field is not None and not callable(field):
        raise OptionError(f"function must take (positions, time), or be None, got {field!r}")
    return field  # type: ignore[no-any-return]


def apply_force_field(context: Context, field: ForceField) -> list[tuple[SoftBody, NDArray[np.float32]]]:
    """Evaluate a force field for all moving bodies, then accelerate them during the next step.

    Returns: the bodies and their accelerations, (n, 3) [m/s^2].
    Raises: errors of the field; OptionError for an invalid result. After an error, no body is changed.
    """
    rows = []
    for body in context.slots.occupants:
        if not body.is_frozen:
            given = field(body.positions(), context.clock.time)
            found = as_array(given, "the result of the force field", (body.vertex_count, 3), "m/s^2")
            if not np.abs(found).max() < MAX_ACCELERATION:
                raise OptionError(f"the force field must stay below {MAX_ACCELERATION:g} m/s^2")
            rows.append((body, found.astype(np.float32)))
    accelerate_bodies(rows)
    return rows


def accelerate_bodies(rows: Sequence[tuple[SoftBody, Any]]) -> None:
    """Accelerate bodies during the next step. Bodies with zero acceleration are not woken.

    Args: rows: bodies, each with the accelerations of its vertices, float32 (n, 3) [m/s^2].
    """
    for body, accelerations in rows:
        if accelerations.any():
            change(body, add_pushes, body.index, accelerations)
