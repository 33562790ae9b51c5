"""Where a particle on its way first touches a collider: sphere tracing along its path (Hart 1996).

A convex solid lies behind the tangent plane at its nearest point. There the path may go on to that plane, and
is clear of the solid if it ends in front of it.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.kinds import CONVEX
from taichi_soft.core.runtime import ti

TOUCHING = 1e-5
"""Distance [m] from a surface within which a particle rests on it: some steps of float32 at ten metres."""

MOST_MARCHES = 16
"""Steps along one path: none is shorter than this part of it, so that one along the surface ends too. At
30 m/s and 240 substeps per second that is 8 mm."""

NEVER = 2.0
"""Part of the way at which what is not touched is touched."""


@ti.func
def rests_at(distance):
    """Whether a particle may stay at a distance from a surface [m] and count as on it.

    To be put onto the surface itself, again and again, would move it along as well, by rounding. What
    friction holds would creep, and feed vibrations.
    """
    return distance >= 0.0 and distance <= TOUCHING


@ti.func
def distance_from(contact: ti.template(), c, x):
    """Distance of a point in a collider's frame from its skin [m], negative inside; no more than that."""
    kind, parameters = contact.collider_kind[c], contact.collider_parameters[c]
    resolution, offset = contact.collider_resolution[c], contact.collider_offset[c]
    distance, _ = signed_distance(contact.samples, kind, parameters, resolution, offset, x)
    return distance - contact.collider_surface[c].z


@ti.func
def first_touch(contact: ti.template(), c, start, end, slack):
    """How a path meets a collider. All in the collider's frame [m].

    Args:
        slack: how far behind where it rests the path may end without touching.
    Returns:
        part: of the way, 0 to 1, at which it touches, or `NEVER`.
        distance: from the surface there, negative where the path starts inside [m].
        beyond: distance of `end` from the surface's tangent plane there, negative [m].
        normal: of the surface there.
    """
    way = end - start
    length = ti.max(way.norm(), 1e-30)
    kind, parameters = contact.collider_kind[c], contact.collider_parameters[c]
    resolution, offset = contact.collider_resolution[c], contact.collider_offset[c]
    thickness = contact.collider_surface[c].z
    is_convex = 0
    for each in ti.static(sorted(CONVEX)):
        is_convex = is_convex | int(kind == each)
    part, distance, beyond, normal = 0.0, 0.0, 0.0, ti.Vector([0.0, 0.0, 1.0])
    is_open = 1
    while is_open == 1:
        to_shape, normal = signed_distance(
            contact.samples, kind, parameters, resolution, offset, start + part * way
        )
        distance = to_shape - thickness
        climb = way.dot(normal)
        beyond = distance + (1.0 - part) * climb
        is_clear = beyond >= ti.select(rests_at(distance), distance, 0.0) - slack
        if distance <= TOUCHING and not is_clear:
            is_open = 0
        elif is_clear and is_convex == 1:
            part, is_open = NEVER, 0
        else:
            step = ti.max(ti.abs(distance) / length, 1.0 / MOST_MARCHES)
            if is_convex == 1:
                step = ti.max(distance / ti.max(-climb, 1e-30), 1.0 / MOST_MARCHES / MOST_MARCHES)
            if part == 1.0:
                part, is_open = NEVER, 0
            else:
                part = ti.min(part + step, 1.0)  # the end is looked at too, or a last step might go beneath
    return part, distance, beyond, normal
