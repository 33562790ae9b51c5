"""Set the velocity of a whole body as if the body were rigid, or teleport the body."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.bodies.description import outer_vertices
from taichi_soft.bodies.soft_body import SoftBody, context_of
from taichi_soft.control.attachments import require_unattached
from taichi_soft.control.change import attempt, mark_modified, numbers, some_particles
from taichi_soft.control.kernels.rigid_motion import write_rigid_velocity
from taichi_soft.control.rigid_transform import jump_to
from taichi_soft.core.checks import as_flag, as_rotation, as_vector
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.rotations import turned


def set_velocity(body: SoftBody, linear: ArrayLike, angular: ArrayLike) -> None:
    """Implement `Body.set_velocity`."""
    motion = numbers(
        as_vector(linear, "linear", "m/s", VELOCITY_LIMIT), as_vector(angular, "angular", "rad/s")
    )
    found = np.empty(1, dtype=np.float32)
    attempt(body, write_rigid_velocity, body.index, motion, found)
    fastest = float(found[0])
    if not fastest < VELOCITY_LIMIT:
        raise OptionError(
            f"linear and angular move a vertex at {fastest:.4g} m/s: stay below {VELOCITY_LIMIT:g} m/s"
        )
    mark_modified(body)


def teleport(body: SoftBody, position: ArrayLike, rotation: Any, keep_velocity: bool) -> None:
    """Implement `Body.teleport`."""
    target, turn = as_vector(position, "position", "m"), as_rotation(rotation)
    keep = as_flag(keep_velocity, "keep_velocity")
    require_unattached(body, some_particles(body, None))
    floor, built = context_of(body).settings.floor, context_of(body).built
    left = built.box_of(body)
    free = np.setdiff1d(outer_vertices(body.mesh), body.pinned)
    if len(free):
        points = turned(body.positions()[free].astype(np.float64) - body.center_of_mass(), turn) + target
        built.require_clear(body, points)
    lowest = -np.inf if floor is None else floor
    bottom, top, farthest = jump_to(body, target, turn, lowest=lowest, keep=keep)
    if not farthest < POSITION_LIMIT:
        raise OptionError(f"position puts the body beyond {POSITION_LIMIT:g} m: move it closer to the origin")
    if bottom < lowest - 1e-3 * (top - bottom):
        raise OptionError(
            f"position={target.tolist()} puts the body {lowest - bottom:.4g} m below the floor: raise it"
        )
    mark_modified(body)
    built.wake_near(*left)
