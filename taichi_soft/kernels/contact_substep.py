"""What one substep makes of one body among colliders: it is pushed, and then it drifts.

Between the two its island takes velocities away, in joints and in contact of bodies with each other.
"""

from taichi_soft.kernels.collide import collided, find_near_colliders
from taichi_soft.kernels.drives import add_reactions, blow_on, push_particles
from taichi_soft.kernels.grabs import pull_grabs
from taichi_soft.kernels.implicit_contact import kick_implicitly
from taichi_soft.kernels.internal_forces import accumulate_forces
from taichi_soft.kernels.motion import gravity_on
from taichi_soft.kernels.per_body import before_kick
from taichi_soft.kernels.rebound import limit_rebounds
from taichi_soft.kernels.sleep import note_motion
from taichi_soft.runtime import ti
from taichi_soft.types import Integrator

WILD = 20.0
"""Way of a particle within one substep, over the mean edge of its body's surface, from which the body is
taken to be exploding: others pass through it until it is frozen or calm."""

JOLT = 1.0
"""Way by which the forces of one substep may move a particle within it, over the mean edge of its body's
surface. Vibrations of a stable substep stay below it."""


@ti.func
def _kick_body(state: ti.template(), program: ti.template(), body, kick, way, common):
    """New velocities from the forces, which are cleared, and positions after `way` [s] with them.

    Returns: the highest speed [m/s], the highest and the mean beside the `common` velocity, and the largest
    change.
    """
    particles = state.body_particles[body]
    gravity = gravity_on(state, body)
    highest, highest_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    total_beside = ti.cast(0.0, state.real)
    largest = ti.cast(0.0, state.real)
    for p in range(particles[0], particles[1]):
        inv_mass = state.particle_inv_mass[p]
        acceleration = state.particle_force[p].xyz * inv_mass + gravity
        acceleration *= ti.select(inv_mass > 0.0, 1.0, 0.0)
        v_before, was_touched = state.particle_velocity[p], state.contact.particle_touches[p]
        x, v = program.advance(state.particle_position[p], v_before, acceleration, way, kick)
        state.particle_position[p] = x
        state.particle_velocity[p] = v
        state.contact.particle_touches[p] = 0
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        highest = ti.max(highest, v.dot(v))
        if ti.static(program.has_soft_contact):
            if way == 0.0:
                state.soft.particle_speed[p] = (v - common).norm()
                # What presses against others gains speed only to lose it to them.
                beside = ti.select(was_touched == 1, v_before, v) - common
                highest_beside = ti.max(highest_beside, beside.dot(beside))
                total_beside += beside.dot(beside)
        largest = ti.max(largest, acceleration.dot(acceleration))
    mean_beside = ti.sqrt(total_beside / (particles[1] - particles[0]))
    return ti.sqrt(highest), ti.sqrt(highest_beside), mean_beside, kick * ti.sqrt(largest)


@ti.func
def push_body(state: ti.template(), program: ti.template(), body, h, since, way, common):
    """New velocities from all but contact and joints; leapfrog also moves particles for `way` [s].

    Notes the highest speed [m/s], the highest and the mean beside the `common` velocity, and whether forces
    moved no particle too far at once.
    """
    kick, is_first = h, int(since == 0.0)
    if is_first == 1:
        kick = 0.5 * (state.body_velocity_lag[body] + h)
    speed, is_gentle = ti.cast(0.0, state.real), 1
    speed_beside, mean_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    edge = state.contact.body_edge[body]
    blow_on(state, body, h)
    push_particles(state, body, before_kick(program, h, is_first))
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        speed, speed_beside = kick_implicitly(state, program, body, h, since, is_first, common)
        mean_beside = speed_beside
    else:
        lasting = kick if ti.static(program.integrator == Integrator.LEAPFROG) else h
        accumulate_forces(state, program, body)
        add_reactions(state, body, lasting)
        pull_grabs(state, body, h, lasting)
        speed, speed_beside, mean_beside, change = _kick_body(state, program, body, kick, way, common)
        is_gentle = int(change * h <= JOLT * edge)
    state.contact.body_speed[body] = speed
    state.contact.body_speed_beside[body] = speed_beside
    state.contact.body_mean_beside[body] = mean_beside
    state.contact.is_gentle[body] = is_gentle
    state.contact.is_wild[body] = 0
    if ti.static(program.has_soft_contact):
        state.contact.is_wild[body] = int(not (speed * h <= WILD * edge))


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
    farthest2 = ti.cast(0.0, state.real)
    for p in range(particles[0], particles[1]):
        x, v = state.particle_position[p], state.particle_velocity[p]
        way = h * v
        if state.contact.particle_clearance[p] <= gone and state.particle_inv_mass[p] > 0.0:
            x_new, v_new = collided(state, body, p, x, v, h, since)
            state.particle_velocity[p] = v_new
            way = x_new - x
        state.particle_position[p] = x + way
        farthest2 = ti.max(farthest2, way.dot(way))
    limit_rebounds(state, body, since + h)
    note_motion(state, body, ti.sqrt(farthest2) / h)
