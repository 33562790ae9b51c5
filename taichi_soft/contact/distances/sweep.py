"""Find the first point at which a particle's path touches a collider, by sphere tracing (Hart 1996).

A convex solid lies behind the tangent plane at its nearest point. So the path can advance to that plane, and
is clear of the solid if it ends in front of it.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import CONVEX
from taichi_soft.core.runtime import ti

TOUCHING = 1e-5
"""Distance [m] from a surface within which a particle rests on it: a few steps of float32 at 10 m."""

MAX_STEPS = 16
"""Steps along one path, at most: each is at least this fraction of it, so that a path along the surface ends
too. At 30 m/s and 240 substeps per second a step is 8 mm."""

NO_TOUCH = 2.0
"""Fraction of the path returned if it touches nothing."""


@ti.func
def rests_at(distance):
    """True if a particle can stay at a distance [m] from a surface and count as resting on it.

    Putting it onto the surface itself in every substep would also move it along the surface, by rounding.
    Particles held by friction would creep, and feed vibrations.
    """
    return distance >= 0.0 and distance <= TOUCHING


@ti.func
def distance_from(colliders: ti.template(), c, x):
    """Lower bound of the distance of a point in a collider's frame from its skin [m], negative inside."""
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    distance, _ = signed_distance(colliders.samples, kind, parameters, resolution, offset, x)
    return distance - colliders.surface[c].z


@ti.func
def first_touch(colliders: ti.template(), c, start, end, slack):
    """Find how a path meets a collider. All lengths and directions are in the collider's frame [m].

    Args:
        slack: distance behind its resting position at which the path can end without touching.
    Returns:
        part: fraction of the path, 0 to 1, at which it touches, or `NO_TOUCH`.
        distance: distance from the surface there, negative if the path starts inside [m].
        beyond: distance of `end` from the tangent plane there, negative [m].
        normal: normal of the surface there.
    """
    path = end - start
    length = ti.max(path.norm(), 1e-30)
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    thickness = colliders.surface[c].z
    is_convex = 0
    for each in ti.static(sorted(CONVEX)):
        is_convex = is_convex | int(kind == each)
    part, distance, beyond, normal = 0.0, 0.0, 0.0, ti.Vector([0.0, 0.0, 1.0])
    is_open = 1
    while is_open == 1:
        to_shape, normal = signed_distance(
            colliders.samples, kind, parameters, resolution, offset, start + part * path
        )
        distance = to_shape - thickness
        climb = path.dot(normal)
        beyond = distance + (1.0 - part) * climb
        is_clear = beyond >= ti.select(rests_at(distance), distance, 0.0) - slack
        if distance <= TOUCHING and not is_clear:
            is_open = 0
        elif is_clear and is_convex == 1:
            part, is_open = NO_TOUCH, 0
        else:
            step = ti.max(ti.abs(distance) / length, 1.0 / MAX_STEPS)
            if is_convex == 1:
                step = ti.max(distance / ti.max(-climb, 1e-30), 1.0 / MAX_STEPS / MAX_STEPS)
            if part == 1.0:
                part, is_open = NO_TOUCH, 0
            else:
                part = ti.min(part + step, 1.0)  # check the end too: the last step could pass below
    return part, distance, beyond, normal
