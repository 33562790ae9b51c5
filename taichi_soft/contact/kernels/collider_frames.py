"""Poses and skins of colliders as a body meets them: relative to its origin, in which the positions of a step
are, and as thick as collider and body together.

Groups of fields: reads colliders, hull.
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


@ti.func
def has_triangles(state: ti.template(), body):
    """Return 1 if a body has a surface of triangles, 0 for a rope or a rod."""
    triangles = state.touching.body_triangles[body]
    return int(triangles[0] < triangles[1])


@ti.func
def radius_of(state: ti.template(), body):
    """Return the radius with which a body touches colliders [m]. Ropes and rods are chains of capsules."""
    return ti.select(has_triangles(state, body) == 1, 0.0, 0.5 * state.body_surface[body].y)


@ti.func
def skin_of(state: ti.template(), body, c):
    """Return the distance from the shape of a collider at which the points of a body touch it [m]."""
    return state.colliders.surface[c].z + radius_of(state, body)
