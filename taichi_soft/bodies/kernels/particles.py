"""Particles before and after a step, and what pulls at all of them."""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.math.finite import is_within
from taichi_soft.core.runtime import ti


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
def particle_is_sound(state: ti.template(), p):
    """True (1) where position and velocity can still be computed with."""
    near = is_within(state.particle_position[p], POSITION_LIMIT)
    return near & is_within(state.particle_velocity[p], VELOCITY_LIMIT)


@ti.func
def moves(state: ti.template(), p):
    """1 where the body of a particle moves, or 0."""
    return ti.select(state.body_status[state.particle_body[p]] == ACTIVE, 1.0, 0.0)


@ti.func
def inv_mass_of(state: ti.template(), p):
    """Inverse mass [1/kg]; zero where the body does not move."""
    return state.particle_inv_mass[p] * moves(state, p)


@ti.func
def velocity(state: ti.template(), p):
    """[m/s]; zero where the body does not move: a frozen one keeps those that broke it."""
    return state.particle_velocity[p] * moves(state, p)
