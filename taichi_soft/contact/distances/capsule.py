"""All points near a piece of the z axis about the origin."""

from taichi_soft.contact.distances.direction import length_and_direction
from taichi_soft.core.runtime import ti


@ti.func
def capsule_distance(parameters, x):
    """Signed distance [m] and normal; along x on the axis. Parameters: radius, half its length."""
    z = ti.max(-parameters[1], ti.min(parameters[1], x[2]))
    length, normal = length_and_direction(ti.Vector([x[0], x[1], x[2] - z]), ti.Vector([1.0, 0.0, 0.0]))
    return length - parameters[0], normal
