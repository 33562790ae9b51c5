"""Signed distance from a capsule: all points within a radius of a segment of the z axis."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti


@ti.func
def capsule_distance(parameters, x):
    """Return signed distance [m] and normal. On the capsule's axis, the normal is the x axis.

    Parameters: radius [m]; half of the distance between the centres of the caps [m].
    """
    z = ti.max(-parameters[1], ti.min(parameters[1], x[2]))
    length, normal = length_and_direction(ti.Vector([x[0], x[1], x[2] - z]), ti.Vector([1.0, 0.0, 0.0]))
    return length - parameters[0], normal
