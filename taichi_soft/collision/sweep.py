"""Where a particle on its way first touches a collider: sphere tracing along its path (Hart 1996)."""

from taichi_soft.collision.distance import signed_distance
from taichi_soft.runtime import ti

TOUCHING = 1e-5
"""Distance [m] within which a particle counts as on the surface: some steps of float32 at ten metres."""

MOST_MARCHES = 32
"""Steps along one path. One that needs more grazes the surface, and is stopped where it is."""

NEVER = 2.0
"""Part of the way at which what is not touched is touched."""


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
        slack: how far beyond the surface the path may end without touching it.
    Returns:
        part: of the way, 0 to 1, at which it touches, or `NEVER`.
        distance: from the surface there, negative where the path starts inside [m].
        beyond: distance of `end` from the surface's tangent plane there, negative [m].
        normal: of the surface there.
    """
    way = end - start
    length = way.norm()
    kind, parameters = contact.collider_kind[c], contact.collider_parameters[c]
    resolution, offset = contact.collider_resolution[c], contact.collider_offset[c]
    thickness = contact.collider_surface[c].z
    part, distance, beyond, normal = 0.0, 0.0, 0.0, ti.Vector([0.0, 0.0, 1.0])
    marches, is_open = 0, 1
    while is_open == 1:
        to_shape, direction = signed_distance(
            contact.samples, kind, parameters, resolution, offset, start + part * way
        )
        distance = to_shape - thickness
        marches += 1
        step = distance
        if distance <= TOUCHING or marches == MOST_MARCHES:
            beyond = distance + (1.0 - part) * way.dot(direction)
            if beyond < -slack:
                normal = direction
                is_open = 0
            step = ti.abs(distance) + TOUCHING  # it leaves this part of the surface, and may meet another
        if is_open == 1:
            part += step / ti.max(length, 1e-30)
            if not (part <= 1.0) or marches >= MOST_MARCHES:
                part = NEVER
                is_open = 0
    return part, distance, beyond, normal
