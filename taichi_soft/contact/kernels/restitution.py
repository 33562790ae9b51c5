"""Compute the velocity of a particle after contact, inelastic or with restitution, and with Coulomb
friction.
"""

from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.core.runtime import ti


@ti.func
def resolved_velocity(v, normal, surface_velocity, friction, restitution):
    """Return the velocity of a particle after contact with a surface of infinite mass [m/s].

    Args:
        v: velocity before the contact [m/s].
        normal: outward normal of the surface, of unit length.
        surface_velocity: velocity of the surface at the contact [m/s].
        friction: Coulomb coefficient, 0 or more: the largest ratio of the changes of the tangential and the
            normal velocity.
        restitution: 0 to 1, for impacts faster than `RESTITUTION_SPEED`; negative values count as 0.
    """
    relative = v - surface_velocity
    approach = -relative.dot(normal)
    bounce = ti.select(approach > RESTITUTION_SPEED, ti.max(restitution, 0.0), 0.0)
    impulse = ti.max(approach, 0.0) * (1.0 + bounce)
    sliding = relative + approach * normal
    slide = sliding.norm()
    keep = 0.0
    if slide > friction * impulse:
        keep = 1.0 - friction * impulse / slide
    return surface_velocity + keep * sliding + (impulse - approach) * normal
