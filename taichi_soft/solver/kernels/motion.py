"""Motion of particles: from force to velocity to position, with the floor in the way."""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.contact.distances.floor import resolve_floor
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator

JOLT = 1.0
"""By how much the forces of one substep may change a particle's velocity, over the speed of sound in its
body. Stable vibrations stay below it, on slivers too: a stable substep is about as long as sound takes to
cross the smallest tetrahedron."""

PRESSED = 4.0
"""The same for a particle that something held in the last substep, over `JOLT`: most of its change is taken
by what it presses against."""


@ti.func
def kick_time(state: ti.template(), program: ti.template(), body, h, s):
    """How long forces act before the drift of substep `s` of `h` [s]: by leapfrog, the first ends the lag."""
    kick = ti.cast(h, state.real)
    if ti.static(program.integrator != Integrator.LAZY_LEAPFROG):  # whose velocities do not lag
        if s == 0:
            kick = 0.5 * (state.body_velocity_lag[body] + h)
    return kick


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
def _move_block(state: ti.template(), program: ti.template(), first, count, gravity, h, kick):
    """New positions and velocities of up to `LANES` particles from `first` on; their forces are cleared. What
    lies behind them is computed too, and counts nothing.

    Returns: of each the square of its acceleration.
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    velocities = ti.Matrix.zero(state.real, LANES, 3)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    # It reads fields and stores here only: whether field and field overlap, the compiler could not tell.
    for lane in range(LANES):
        p = first + lane
        x, v, a = moved_particle(state, program, p, state.particle_force[p].xyz, gravity, h, kick)
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
            velocities[lane, i] = v[i]
        acceleration2[lane] = a.dot(a)
    if count >= LANES:
        _put_block(state, first, LANES, positions, velocities)
    else:
        _put_block(state, first, count, positions, velocities)
        for lane in range(LANES):
            acceleration2[lane] = ti.select(lane < count, acceleration2[lane], 0.0)
    return acceleration2


@ti.func
def _put_block(state: ti.template(), first, count, positions: ti.template(), velocities: ti.template()):
    """Field by field: a loop over one field, of a length that is known, becomes a few wide stores."""
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_position[first + lane][i] = positions[lane, i]
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_velocity[first + lane][i] = velocities[lane, i]
    for lane in range(count):
        state.particle_force[first + lane] = ti.Vector.zero(state.real, 4)


@ti.func
def move_body(state: ti.template(), program: ti.template(), body, h, kick):
    """Move all particles of one body and clear their forces.

    Returns: whether these moved no particle too far at once (1).
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        a2 = _move_block(state, program, first, particles[1] - first, gravity, h, kick)
        acceleration2 = ti.max(acceleration2, a2)
    return int(kick * ti.sqrt(acceleration2.max()) <= JOLT * state.body_sound_speed[body])
