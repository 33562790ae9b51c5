"""State of particles before and after a step, and gravity."""

from taichi_soft.bodies.status import ACTIVE
from taichi_soft.core.constants import LANES, POSITION_LIMIT, ROW_BITS, VELOCITY_LIMIT
from taichi_soft.core.math.finite import is_within
from taichi_soft.core.runtime import ti


@ti.func
def save_particle(state: ti.template(), p):
    """Save the state of a particle before the step, for interpolation and for retries."""
    state.prev_position[p] = state.particle_position[p]
    state.prev_velocity[p] = state.particle_velocity[p]


@ti.func
def highest_speed(state: ti.template(), body):
    """Return the highest speed of a body's particles [m/s]."""
    particles, speed2 = state.body_particles[body], ti.Vector.zero(state.real, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        for lane in range(LANES):
            v = state.particle_velocity[first + lane]
            speed2[lane] = ti.max(speed2[lane], ti.select(first + lane < particles[1], v.dot(v), 0.0))
    return ti.sqrt(speed2.max())


@ti.func
def largest_displacement(state: ti.template(), body):
    """Return the largest displacement of a body's particles since `save_particle` [m]."""
    particles, squares = state.body_particles[body], ti.Vector.zero(ti.f32, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        for lane in range(LANES):
            d = state.particle_position[first + lane] - state.prev_position[first + lane]
            squares[lane] = ti.max(squares[lane], ti.select(first + lane < particles[1], d.dot(d), 0.0))
    return ti.sqrt(squares.max())


@ti.func
def restore_particle(state: ti.template(), p):
    """Restore the state of a particle that `save_particle` saved."""
    state.particle_position[p] = state.prev_position[p]
    state.particle_velocity[p] = state.prev_velocity[p]


@ti.func
def gravity_on(state: ti.template(), body):
    """Return the acceleration of one body due to gravity [m/s^2]."""
    return state.gravity[None] * state.body_gravity_scale[body]


@ti.func
def particle_is_valid(state: ti.template(), p, origin):
    """Return 1 if the position and the velocity of a particle are within their limits, else 0.

    Args: origin: origin of the body, to which positions are relative in a step [m].
    """
    in_range = is_within(state.particle_position[p] + origin, POSITION_LIMIT)
    return in_range & is_within(state.particle_velocity[p], VELOCITY_LIMIT)


@ti.func
def moves(state: ti.template(), p):
    """Return 1 if the body of a particle moves, else 0."""
    return ti.select(state.body_status[state.particle_body[p]] == ACTIVE, 1.0, 0.0)


@ti.func
def inv_mass_of(state: ti.template(), p):
    """Return the inverse mass of a particle [1/kg], or zero if its body does not move."""
    return state.particle_inv_mass[p] * moves(state, p)


@ti.func
def velocity(state: ti.template(), p):
    """Return the velocity of a particle [m/s], or zero if its body does not move.

    The stored velocities of a frozen body are invalid.
    """
    return state.particle_velocity[p] * moves(state, p)
