"""Find the first point at which a particle's path touches a collider, by sphere tracing (Hart 1996).

A convex solid lies behind the tangent plane at its nearest point. The particle can therefore advance to that
plane, and touches nothing if its path ends in front of the plane.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import CONVEX
from taichi_soft.core.runtime import ti

TOUCHING = 1e-5
"""Largest distance of a resting particle from a surface [m]. It is a few float32 spacings at 10 m."""

MAX_STEPS = 16
"""Largest number of steps along a path near a solid that is not convex. Each step is at least 1/16 of the
path, so that a search along the surface ends too. At 30 m/s and 240 substeps per second, this is 8 mm. Near a
convex solid, steps can be as short as 1/256 of the path."""

NO_TOUCH = 2.0
"""Value that is returned in place of a fraction from 0 to 1 if the path touches nothing."""


@ti.func
def rests_at(distance):
    """True if a particle at this distance [m] from a surface rests on the surface, and need not be moved.

    Moving the particle exactly onto the surface in every substep would also move it along the surface,
    because of rounding. Particles held by friction would then creep and excite vibrations.
    """
    return distance >= 0.0 and distance <= TOUCHING


@ti.func
def distance_from(colliders: ti.template(), c, x):
    """Return a lower bound of a point's distance from a collider's shape [m], negative inside.

    Args: x: the point in the collider's frame [m].
    """
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    distance, _ = signed_distance(colliders.samples, kind, parameters, resolution, offset, x)
    return distance


@ti.func
def first_touch(colliders: ti.template(), c, start, end, slack, skin):
    """Find the first touch of a path with a collider. Points and directions are in the collider's frame [m].

    Args:
        slack: distance that the path can end behind the resting position without a touch.
        skin: distance from the collider's shape that counts as a touch [m].
    Returns:
        part: fraction of the path, 0 to 1, at the first touch; `NO_TOUCH` without a touch.
        distance: distance from the surface at the touch, negative if the path starts inside [m].
        beyond: signed distance of `end` from the tangent plane at the touch, negative behind it [m].
        normal: normal of the surface at the touch.
    """
    path = end - start
    length = ti.max(path.norm(), 1e-30)
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    is_convex = 0
    for each in ti.static(sorted(CONVEX)):
        is_convex = is_convex | int(kind == each)
    part, distance, beyond, normal = 0.0, 0.0, 0.0, ti.Vector([0.0, 0.0, 1.0])
    is_open = 1
    while is_open == 1:
        to_shape, normal = signed_distance(
            colliders.samples, kind, parameters, resolution, offset, start + part * path
        )
        distance = to_shape - skin
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
                part = ti.min(part + step, 1.0)  # do not step over the end of the path
    return part, distance, beyond, normal
