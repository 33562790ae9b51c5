"""Poses of colliders relative to the origin of a body, in which the positions of a step are.

Groups of fields: reads colliders.
"""

from taichi_soft.core.math.quaternion import spun, turned_back
from taichi_soft.core.runtime import ti


@ti.func
def start_of(state: ti.template(), body, c):
    """Return the position of a collider at the start of the step, relative to the origin of a body [m]."""
    return state.colliders.position[c] - state.body_origin[body] + state.colliders.position_residue[c]


@ti.func
def center_of(state: ti.template(), body, c, time):
    """Return the position of a collider relative to the origin of a body [m].

    Args: time: time after the start of the step [s].
    """
    return start_of(state, body, c) + state.colliders.velocity[c] * time


@ti.func
def in_frame(state: ti.template(), body, c, x, time):
    """Transform the point `x`, relative to the origin of a body, to the frame of a collider.

    Args: time: time after the start of the step [s].
    """
    position = center_of(state, body, c, time)
    return turned_back(spun(state.colliders.rotation[c], state.colliders.spin[c] * time), x - position)
