"""Motion of particles: from force to velocity to position, with the floor in the way."""

from taichi_soft.collision.floor import resolve_floor
from taichi_soft.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.math.finite import is_within
from taichi_soft.runtime import ti


@ti.func
def remember_particle(state: ti.template(), p):
    """Keep where a particle is before the step: to interpolate from, and to fall back to."""
    state.prev_position[p] = state.particle_position[p]
    state.prev_velocity[p] = state.particle_velocity[p]


@ti.func
def restore_particle(state: ti.template(), p):
    """Put a particle back to where it was before the step."""
    state.particle_position[p] = state.prev_position[p]
    state.particle_velocity[p] = state.prev_velocity[p]


@ti.func
def gravity_on(state: ti.template(), body):
    """Gravity as one body feels it [m/s^2]."""
    return state.gravity[None] * state.body_gravity_scale[body]


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


@ti.func
def particle_is_sound(state: ti.template(), p):
    """True (1) where position and velocity can still be computed with."""
    near = is_within(state.particle_position[p], POSITION_LIMIT)
    return near & is_within(state.particle_velocity[p], VELOCITY_LIMIT)
