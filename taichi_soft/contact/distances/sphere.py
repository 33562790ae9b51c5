"""Signed distance from a sphere centred on the origin."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti


@ti.func
def sphere_distance(parameters, x):
    """Return signed distance [m] and normal. At the centre, the normal is the z axis.

    Parameters: radius [m].
    """
    length, normal = length_and_direction(x, ti.Vector([0.0, 0.0, 1.0]))
    return length - parameters[0], normal
