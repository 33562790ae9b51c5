"""The horizontal floor: a plane with restitution and Coulomb friction."""

from taichi_soft.core.runtime import ti

RESTITUTION_SPEED = 0.5
"""Impact speed [m/s] below which bodies do not bounce, so that they come to rest."""


@ti.func
def resolve_floor(x, v, h, floor):
    """Return position and velocity of a particle after contact with the floor in a substep.

    The impulse acts before the drift, so it also shortens the path. Otherwise, a particle held by friction
    would creep.
    Args:
        x: position after the drift, without contact [m].
        v: velocity during the drift, without contact [m/s].
        h: substep [s].
        floor: height [m], restitution 0 to 1, friction coefficient 0 or more.
    """
    x_out, v_out = x, v
    if x.z < floor.x:
        bounce = ti.select(v.z < -RESTITUTION_SPEED, floor.y, 0.0)
        impulse = ti.max(-v.z, 0.0) * (1.0 + bounce)
        slide = ti.sqrt(v.x * v.x + v.y * v.y)
        keep = 0.0
        if slide > floor.z * impulse:
            keep = 1.0 - floor.z * impulse / slide
        v_out = ti.Vector([v.x * keep, v.y * keep, v.z + impulse])
        x_out = ti.Vector([x.x + h * (v_out.x - v.x), x.y + h * (v_out.y - v.y), floor.x])
    return x_out, v_out
