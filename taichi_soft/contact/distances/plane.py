"""Signed distance from the solid half-space below a plane through the origin."""

from taichi_soft.core.runtime import ti


@ti.func
def plane_distance(parameters, x):
    """Return signed distance [m] and normal. Parameters: unit normal of the plane (3)."""
    normal = ti.Vector([parameters[0], parameters[1], parameters[2]])
    return normal.dot(x), normal
