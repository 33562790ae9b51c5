"""What one substep makes of one body among colliders: it is pushed, and then it drifts.

Between the two its island takes velocities away, in joints and in contact of bodies with each other.
"""

from taichi_soft.bodies.kernels.motion import gravity_on
from taichi_soft.contact.kernels.collide import collided, find_near_colliders
from taichi_soft.contact.kernels.rebound import limit_rebounds
from taichi_soft.control.kernels.drives import add_reactions, blow_on, push_particles
from taichi_soft.control.kernels.grabs import pull_grabs
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.core.types import Integrator
from taichi_soft.elements.kernels.internal_forces import accumulate_forces
from taichi_soft.solver.kernels.implicit_contact import kick_implicitly
from taichi_soft.solver.kernels.per_body import JOLT, before_kick
from taichi_soft.solver.kernels.sleep import note_motion
from taichi_soft.solver.kernels.vibration import damp_vibration

WILD = 20.0
"""Way of a particle within one substep, over the mean edge of its body's surface, from which the body is
taken to be exploding: others pass through it until it is frozen or calm."""


@ti.func
def _put_block(
    state: ti.template(),
    program: ti.template(),
    first,
    count,
    positions: ti.template(),
    velocities: ti.template(),
    speeds_beside: ti.template(),
):
    """Write what a kick made of `count` particles from `first` on, and clear what the next one begins with.

    Field by field: a loop over one field, of a length that the compiler knows, becomes a few wide stores.
    """
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_position[first + lane][i] = positions[lane, i]
    for lane in range(count):
        for i in ti.static(range(3)):
            state.particle_velocity[first + lane][i] = velocities[lane, i]
    if ti.static(program.has_soft_contact):
        for lane in range(count):
            state.soft.particle_speed[first + lane] = speeds_beside[lane]
    for lane in range(count):
        state.contact.particle_touches[first + lane] = 0
    for lane in range(count):
        state.particle_force[first + lane] = ti.Vector.zero(state.real, 4)


@ti.func
def _kick_block(state: ti.template(), program: ti.template(), first, count, gravity, kick, way, common):
    """New velocities from the forces, which are cleared, of up to `LANES` particles from `first` on, and
    positions after `way` [s] with them. What lies behind them is computed too, and counts nothing.

    Returns: of each the square of its speed, of that beside the `common` velocity, and of its acceleration.
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    velocities = ti.Matrix.zero(state.real, LANES, 3)
    speeds_beside = ti.Vector.zero(state.real, LANES)
    speed2, beside2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    # It reads fields and stores here only: whether field and field overlap, the compiler could not tell.
    for lane in range(LANES):
        p = first + lane
        inv_mass = state.particle_inv_mass[p]
        # All four numbers of a force, of which the last is 0: wide loads leave no gaps.
        acceleration = state.particle_force[p] * inv_mass + widened(gravity)
        acceleration *= ti.select(inv_mass > 0.0, 1.0, 0.0)
        v_before = state.particle_velocity[p]
        x, v = program.advance(state.particle_position[p], v_before, acceleration.xyz, way, kick)
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
            velocities[lane, i] = v[i]
        if ti.static(program.has_soft_contact):
            speeds_beside[lane] = (v - common).norm()
            # What presses against others gains speed only to lose it to them.
            was_touched = state.contact.particle_touches[p] == 1
            beside = ti.select(was_touched, v_before, v) - common
            beside2[lane] = ti.select(lane < count, beside.dot(beside), 0.0)
        speed2[lane] = ti.select(lane < count, v.dot(v), 0.0)
        acceleration2[lane] = ti.select(lane < count, acceleration.dot(acceleration), 0.0)
    if count >= LANES:
        _put_block(state, program, first, LANES, positions, velocities, speeds_beside)
    else:
        _put_block(state, program, first, count, positions, velocities, speeds_beside)
    return speed2, beside2, acceleration2


@ti.func
def _kick_body(state: ti.template(), program: ti.template(), body, kick, way, common):
    """New velocities from the forces, which are cleared, and positions after `way` [s] with them.

    Returns: the highest speed [m/s], the highest and the mean beside the `common` velocity, and the largest
    change.
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    count = particles[1] - particles[0]
    speed2, beside2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    acceleration2, total2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    for block in range((count + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        v2, b2, a2 = _kick_block(state, program, first, particles[1] - first, gravity, kick, way, common)
        speed2, beside2 = ti.max(speed2, v2), ti.max(beside2, b2)
        acceleration2, total2 = ti.max(acceleration2, a2), total2 + b2
    change = kick * ti.sqrt(acceleration2.max())
    return ti.sqrt(speed2.max()), ti.sqrt(beside2.max()), ti.sqrt(total2.sum() / count), change


@ti.func
def push_body(state: ti.template(), program: ti.template(), body, h, since, way, whole, common):
    """New velocities from all but contact and joints, in one substep of a step of `whole` [s].

    Leapfrog also moves particles for `way` [s].

    Notes the highest speed [m/s], the highest and the mean beside the `common` velocity, and whether forces
    moved no particle too far at once.
    """
    kick, is_first = h, int(since == 0.0)
    if is_first == 1:
        kick = 0.5 * (state.body_velocity_lag[body] + h)
    speed, is_gentle = ti.cast(0.0, state.real), 1
    speed_beside, mean_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    edge = state.body_edge[body]
    blow_on(state, body, h)
    push_particles(state, body, before_kick(program, h, is_first))
    s, substeps = ti.cast(ti.round(since / h), ti.i32), ti.cast(ti.round(whole / h), ti.i32)
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        damp_vibration(state, program, body, 0.0, h, s, substeps)
        speed, speed_beside = kick_implicitly(state, program, body, h, since, is_first, common)
        mean_beside = speed_beside
    else:
        lasting = kick if ti.static(program.integrator == Integrator.LEAPFROG) else h
        accumulate_forces(state, program, body)
        add_reactions(state, body, lasting)
        pull_grabs(state, body, h, lasting)
        damp_vibration(state, program, body, lasting, h, s, substeps)
        speed, speed_beside, mean_beside, change = _kick_body(state, program, body, kick, way, common)
        is_gentle = int(change <= JOLT * state.body_sound_speed[body])
    # Bodies beside each other in a field share a cache line, which every write takes from other threads: what
    # is as it was is not written.
    state.contact.body_speed[body] = speed
    if state.contact.is_gentle[body] != is_gentle:
        state.contact.is_gentle[body] = is_gentle
    if ti.static(program.has_soft_contact):
        state.contact.body_speed_beside[body] = speed_beside
        state.contact.body_mean_beside[body] = mean_beside
        is_wild = int(not (speed * h <= WILD * edge))
        if state.contact.is_wild[body] != is_wild:
            state.contact.is_wild[body] = is_wild


@ti.func
def is_clear(state: ti.template(), body, way):
    """Whether a body meets no collider on its next `way` [m] (1)."""
    return int(
        state.contact.near_count[body] == 0 and state.contact.gone[body] + way <= state.contact.reach[body]
    )


@ti.func
def has_drifted(state: ti.template(), body, speed, h):
    """Take note that a body alone has moved; put it back where it may have met something (0)."""
    clear = is_clear(state, body, speed * h)
    if clear == 1:
        state.contact.gone[body] = state.contact.gone[body] + speed * h
        note_motion(state, body, speed)
    else:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            state.particle_position[p] = state.particle_position[p] - h * state.particle_velocity[p]
    return clear


@ti.func
def _drift_block(state: ti.template(), body, first, count, h, since, gone):
    """New positions of up to `LANES` particles from `first` on, one by one of those that may meet a collider.

    Returns: the square of the way of each [m^2].
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    way2, passes = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):
        p = first + lane
        way = h * state.particle_velocity[p]
        x = state.particle_position[p] + way
        is_far = state.contact.particle_clearance[p] > gone or state.particle_inv_mass[p] <= 0.0
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
        passes[lane] = ti.select(is_far, 1.0, 0.0)
        way2[lane] = ti.select(lane < count, way.dot(way), 0.0)
    if count >= LANES and passes.min() > 0.0:
        for lane in range(LANES):
            for i in ti.static(range(3)):
                state.particle_position[first + lane][i] = positions[lane, i]
    else:
        for lane in range(ti.min(count, LANES)):
            p = first + lane
            if passes[lane] > 0.0:
                for i in ti.static(range(3)):
                    state.particle_position[p][i] = positions[lane, i]
            else:
                x = state.particle_position[p]
                x_new, v_new = collided(state, body, p, x, state.particle_velocity[p], h, since)
                state.particle_position[p] = x + (x_new - x)
                state.particle_velocity[p] = v_new
                way2[lane] = (x_new - x).dot(x_new - x)
    return way2


@ti.func
def drift_body(state: ti.template(), body, h, since, left, fastest):
    """New positions, and what colliders in the way make of velocities.

    Args:
        since, left: time since the start of the step, and until its end [s].
        fastest: speed of what is fastest in the island [m/s].
    """
    gone = state.contact.gone[body] + fastest * h
    if not (state.contact.reach[body] >= gone):
        # A quarter more than the rest of the step needs at this speed.
        find_near_colliders(state, body, 1.25 * fastest * left + 1e-3, since, left)
        gone = fastest * h
    state.contact.gone[body] = gone
    particles = state.body_particles[body]
    way2 = ti.Vector.zero(state.real, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        way2 = ti.max(way2, _drift_block(state, body, first, particles[1] - first, h, since, gone))
    limit_rebounds(state, body, since + h)
    note_motion(state, body, ti.sqrt(way2.max()) / h)
