"""What contact does to the velocity of a particle: inelastic or restituting, with Coulomb friction."""

from taichi_soft.contact.distances.floor import RESTITUTION_SPEED
from taichi_soft.core.runtime import ti


@ti.func
def resolved_velocity(v, normal, surface_velocity, friction, restitution):
    """Velocity after contact with a surface of infinite mass [m/s].

    Args:
        v: velocity before [m/s].
        normal: of the surface, outward, of unit length.
        surface_velocity: of the surface at the contact [m/s].
        friction: coefficient, 0 or more. What the surface takes from the normal velocity bounds what it may
            take from the tangential one.
        restitution: 0 to 1, for impacts faster than `RESTITUTION_SPEED`; below 0 as 0.
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
