"""Motion of particles: from force to velocity to position, with the floor in the way."""

from taichi_soft.contact.distances.floor import resolve_floor
from taichi_soft.core.runtime import ti


@ti.func
def moved_particle(state: ti.template(), program: ti.template(), p, force, gravity, h, kick):
    """One substep of one particle under the internal force on it [N]; a pinned one keeps its velocity.

    Returns: its new position [m] and velocity [m/s], and its acceleration [m/s^2].
    """
    inv_mass = state.particle_inv_mass[p]
    is_free = inv_mass > 0.0
    acceleration = (force * inv_mass + gravity) * ti.select(is_free, 1.0, 0.0)
    x, v = program.advance(state.particle_position[p], state.particle_velocity[p], acceleration, h, kick)
    if ti.static(program.has_floor):
        if is_free:
            x, v = resolve_floor(x, v, h, state.floor[None])
    return x, v, acceleration
