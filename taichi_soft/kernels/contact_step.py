"""Schedule `per_body` where bodies touch more than the floor: one thread makes all substeps of an island.

A substep goes in the order velocity, joints, contact, position: contact takes velocities away before they
move anything, and what it changes of joints they make good in the next substep.

Substeps are chosen for small deformation; an impact faster than sound flattens tetrahedra, which are stiffer
then. Where a step ends non-finite, or forces moved a particle by more than `JOLT` edges at once, the island
is put back to where it was, and makes the step again with twice as many substeps, up to `MOST_FINER` times
as many.
"""

from taichi_soft.kernels.collide import collided, find_near_colliders, forget_contacts
from taichi_soft.kernels.drives import add_reactions, blow_on, push_particles
from taichi_soft.kernels.grabs import pull_grabs
from taichi_soft.kernels.implicit_contact import kick_implicitly
from taichi_soft.kernels.implicit_euler import MOST_PIECES, keeps_shape
from taichi_soft.kernels.internal_forces import accumulate_forces, clear_forces
from taichi_soft.kernels.islands import find_islands
from taichi_soft.kernels.joints import solve_joints
from taichi_soft.kernels.motion import gravity_on, remember_particle, restore_particle
from taichi_soft.kernels.per_body import before_kick, body_is_sound, end_body
from taichi_soft.kernels.rebound import begin_rebounds, limit_rebounds, take_back_rebounds
from taichi_soft.kernels.sleep import note_motion, settle_island, wake_by_colliders, wake_island
from taichi_soft.kernels.soft_contact import solve_island
from taichi_soft.kernels.soft_search import (
    find_box,
    forget_candidates,
    is_social,
    island_margin,
    search_body,
    search_island,
)
from taichi_soft.kernels.touches import add_touches, forget_touches
from taichi_soft.runtime import ti
from taichi_soft.state import ABSENT, ACTIVE, FEELS_REACTION, JOINED
from taichi_soft.types import Integrator

WILD = 20.0
"""Way of a particle within one substep, over the mean edge of its body's surface, from which the body is
taken to be exploding: others pass through it until it is frozen or calm."""

JOLT = 1.0
"""Way by which the forces of one substep may move a particle within it, over the mean edge of its body's
surface. Vibrations of a stable substep stay below it."""

ALL_SLEEP = -1
"""Instead of a number of bodies: none is awake, and the next step would find all as it is."""

MOST_FINER = 8
"""Times as many substeps as asked for, at most."""


@ti.func
def _begin_body(state: ti.template(), body):
    if state.body_status[body] != ABSENT:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            remember_particle(state, p)
            if ti.static(state.capacity.implicit):
                state.prev_contact[p] = state.particle_contact[p]
        if state.body_drives[body] & FEELS_REACTION != 0:
            for p in range(particles[0], particles[1]):
                state.contact.prev_reaction[p] = state.particle_reaction[p]
        begin_rebounds(state, body)
        forget_contacts(state, body)
        state.contact.is_wild[body] = 0


@ti.func
def _take_back(state: ti.template(), program: ti.template(), island):
    """Put an island back to where it was before the step."""
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            restore_particle(state, p)
            if ti.static(state.capacity.implicit):
                state.particle_contact[p] = state.prev_contact[p]
            if state.body_drives[body] & FEELS_REACTION != 0:
                state.particle_reaction[p] = state.contact.prev_reaction[p]
        clear_forces(state, body)
        take_back_rebounds(state, body)
        forget_contacts(state, body)
        if ti.static(program.has_soft_contact):
            forget_candidates(state, body)  # for good, as the island looks for others before it goes on
    if ti.static(program.has_soft_contact):
        forget_touches(state, island)


@ti.func
def _island_is_sound(state: ti.template(), island):
    """Whether all that moves in an island can still be computed with (1)."""
    sound = 1
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            sound = sound & body_is_sound(state, body)
    return sound


@ti.func
def _kick_body(state: ti.template(), program: ti.template(), body, kick, way, common):
    """New velocities from the forces, which are cleared, and positions after `way` [s] with them.

    Returns: the highest speed [m/s], the highest beside the `common` velocity, and the largest change.
    """
    particles = state.body_particles[body]
    gravity = gravity_on(state, body)
    highest, highest_beside = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    largest = ti.cast(0.0, state.real)
    for p in range(particles[0], particles[1]):
        inv_mass = state.particle_inv_mass[p]
        acceleration = state.particle_force[p].xyz * inv_mass + gravity
        acceleration *= ti.select(inv_mass > 0.0, 1.0, 0.0)
        x, v = program.advance(
            state.particle_position[p], state.particle_velocity[p], acceleration, way, kick
        )
        state.particle_position[p] = x
        state.particle_velocity[p] = v
        state.contact.particle_touches[p] = 0
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        highest = ti.max(highest, v.dot(v))
        if ti.static(program.has_soft_contact) and way == 0.0:
            beside = v - common
            highest_beside = ti.max(highest_beside, beside.dot(beside))
        largest = ti.max(largest, acceleration.dot(acceleration))
    return ti.sqrt(highest), ti.sqrt(highest_beside), kick * ti.sqrt(largest)


@ti.func
def _push_body(state: ti.template(), program: ti.template(), body, h, kick, since, way, common):
    """New velocities from all but contact and joints; leapfrog also moves particles for `way` [s].

    Returns: the highest speed [m/s], the highest beside the `common` velocity, and whether forces moved no
    particle too far at once (1).
    """
    is_first = int(since == 0.0)
    speed, speed_beside, is_gentle = ti.cast(0.0, state.real), ti.cast(0.0, state.real), 1
    blow_on(state, body, h)
    push_particles(state, body, before_kick(program, h, is_first))
    if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
        speed, speed_beside = kick_implicitly(state, program, body, h, since, is_first, common)
    else:
        lasting = kick if ti.static(program.integrator == Integrator.LEAPFROG) else h
        accumulate_forces(state, program, body)
        add_reactions(state, body, lasting)
        pull_grabs(state, body, h, lasting)
        speed, speed_beside, change = _kick_body(state, program, body, kick, way, common)
        is_gentle = int(change * h <= JOLT * state.contact.body_edge[body])
    return speed, speed_beside, is_gentle


@ti.func
def _is_alone(state: ti.template(), program: ti.template(), island):
    """Whether nothing but colliders can touch what is in an island (1); by implicit Euler, never."""
    body = state.contact.island_body[state.contact.island_first[island]]
    bodies = state.contact.island_first[island + 1] - state.contact.island_first[island]
    is_explicit = ti.static(program.integrator != Integrator.IMPLICIT_EULER)
    alone = int(is_explicit) & int(bodies == 1) & int(state.body_drives[body] & JOINED == 0)
    if ti.static(program.has_soft_contact):
        alone = alone & (1 - is_social(state, island))
    return alone


@ti.func
def _is_clear(state: ti.template(), body, way):
    """Whether a body meets no collider on its next `way` [m] (1)."""
    return int(
        state.contact.near_count[body] == 0 and state.contact.gone[body] + way <= state.contact.reach[body]
    )


@ti.func
def _has_drifted(state: ti.template(), body, speed, h):
    """Take note that a body alone has moved; put it back where it may have met something (0)."""
    clear = _is_clear(state, body, speed * h)
    if clear == 1:
        state.contact.gone[body] = state.contact.gone[body] + speed * h
        note_motion(state, body, speed)
    else:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            state.particle_position[p] = state.particle_position[p] - h * state.particle_velocity[p]
    return clear


@ti.func
def _drift_body(state: ti.template(), body, h, since, left, fastest, common):
    """New positions, and what colliders in the way make of velocities.

    Args:
        since, left: time since the start of the step, and until its end [s].
        fastest: speed of what is fastest in the island [m/s].
    Returns: the highest speed [m/s], and the highest beside the `common` velocity.
    """
    gone = state.contact.gone[body] + fastest * h
    if not (state.contact.reach[body] >= gone):
        # A quarter more than the rest of the step needs at this speed.
        find_near_colliders(state, body, 1.25 * fastest * left + 1e-3, since, left)
        gone = fastest * h
    state.contact.gone[body] = gone
    particles = state.body_particles[body]
    farthest2, farthest_beside2 = ti.cast(0.0, state.real), ti.cast(0.0, state.real)
    for p in range(particles[0], particles[1]):
        x, v = state.particle_position[p], state.particle_velocity[p]
        way = h * v
        if state.contact.particle_clearance[p] <= gone and state.particle_inv_mass[p] > 0.0:
            x_new, v_new = collided(state, body, p, x, v, h, since)
            state.particle_velocity[p] = v_new
            way = x_new - x
        state.particle_position[p] = x + way
        farthest2 = ti.max(farthest2, way.dot(way))
        beside = way - h * common
        farthest_beside2 = ti.max(farthest_beside2, beside.dot(beside))
    limit_rebounds(state, body, since + h)
    return ti.sqrt(farthest2) / h, ti.sqrt(farthest_beside2) / h


@ti.real_func
def _touch_each_other(
    state: ti.template(), island: ti.i32, reach: ti.f32, gone: ti.f32, fastest: ti.f32, h: ti.f32
) -> (ti.f32, ti.f32):
    """Contact between bodies of one island in a substep; looks for candidates again where they have aged.

    Args:
        reach, gone: way [m] for which the candidates hold, and how much of it may be gone.
        fastest: speed [m/s] before contact, beside what all have in common.
    Returns: `reach` and `gone` as they are now.
    """
    way = 2.0 * fastest * h
    holds, gone_now, used = reach, gone, gone + way
    if is_social(state, island) == 1:
        if not (used <= holds):
            least, thickness = island_margin(state, island)
            holds, gone_now, used = ti.max(way, least), ti.cast(0.0, ti.f32), way
            search_island(state, island, thickness + holds)
        gone_now += 2.0 * solve_island(state, island, h, used, way)
        if state.soft.records_touches[None] == 1:
            add_touches(state, island)
    return holds, gone_now


@ti.real_func
def _end_substep(
    state: ti.template(),
    program: ti.template(),
    island: ti.i32,
    h: ti.f32,
    since: ti.f32,
    left: ti.f32,
    fastest: ti.f32,
    fastest_beside: ti.f32,
    common: ti.math.vec3,
    reach: ti.f32,
    gone: ti.f32,
) -> (ti.f32, ti.f32):
    """What joints and contact make of new velocities, and the new positions.

    Args:
        since, left: time since the start of the step, and until its end [s].
        fastest, fastest_beside: highest speed in the island [m/s], and the highest beside `common`.
        reach, gone: way [m] for which candidates hold, and how much of it may be gone.
    Returns: `reach` and `gone` after the substep.
    """
    held, held_beside = ti.cast(0.0, ti.f32), ti.cast(0.0, ti.f32)
    if ti.static(program.integrator != Integrator.IMPLICIT_EULER):
        held, held_beside = solve_joints(state, island, h, int(since == 0.0), common)
    highest, holds, used = ti.max(fastest, held), reach, gone
    if ti.static(program.has_soft_contact):
        holds, used = _touch_each_other(state, island, reach, gone, ti.max(fastest_beside, held_beside), h)
    farthest = ti.cast(0.0, ti.f32)
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            speed, speed_beside = _drift_body(state, body, h, since, left, highest, common)
            note_motion(state, body, speed)
            if state.contact.is_wild[body] == 0:
                farthest = ti.max(farthest, speed_beside)
    return holds, used + 2.0 * h * farthest


@ti.func
def _common_velocity(state: ti.template(), island):
    """Mean velocity of the particles of an island [m/s]: what its bodies share brings none nearer."""
    total, count = ti.Vector.zero(ti.f32, 3), 0
    for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
        particles = state.body_particles[state.contact.island_body[i]]
        for p in range(particles[0], particles[1]):
            total += state.particle_velocity[p]
        count += particles[1] - particles[0]
    return total / count


@ti.func
def _move_island(state: ti.template(), program: ti.template(), island, substeps, h, age):
    """All substeps of an island that is awake, from `age` [m] of way since candidates were looked for.

    Returns: whether forces moved no particle too far at once (1).
    """
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    first_body = state.contact.island_body[first]
    reach, gone, is_gentle = ti.cast(0.0, ti.f32), age, 1
    common = ti.Vector.zero(ti.f32, 3)
    if ti.static(program.has_soft_contact):
        reach, _ = island_margin(state, island)
        common = _common_velocity(state, island)
    is_alone, fastest = _is_alone(state, program, island), ti.cast(0.0, ti.f32)
    for s in range(substeps):
        has_moved, way = 0, h * ti.cast(is_alone & _is_clear(state, first_body, fastest * h), ti.f32)
        fastest = 0.0
        fastest_beside = ti.cast(0.0, ti.f32)
        common += h * state.gravity[None]
        for i in range(first, last):
            body = state.contact.island_body[i]
            if state.body_status[body] == ACTIVE:
                kick = h
                if s == 0:
                    kick = 0.5 * (state.body_velocity_lag[body] + h)
                speed, speed_beside, gently = _push_body(state, program, body, h, kick, s * h, way, common)
                is_gentle = is_gentle & gently
                if way > 0.0:
                    has_moved = _has_drifted(state, body, speed, h)
                edge = state.contact.body_edge[body]
                state.contact.is_wild[body] = 0
                if ti.static(program.has_soft_contact):
                    state.contact.is_wild[body] = int(not (speed * h <= WILD * edge))
                fastest = ti.max(fastest, speed)
                if state.contact.is_wild[body] == 0:  # or the others' candidates would age by its speed
                    fastest_beside = ti.max(fastest_beside, speed_beside)
        if has_moved == 0:
            left = h * (substeps - s)
            reach, gone = _end_substep(
                state, program, island, h, s * h, left, fastest, fastest_beside, common, reach, gone
            )
        if ti.static(program.integrator == Integrator.IMPLICIT_EULER):
            for i in range(first, last):
                body = state.contact.island_body[i]
                if state.body_status[body] == ACTIVE:
                    is_gentle = is_gentle & int(keeps_shape(state, body))
    return is_gentle


@ti.func
def _step_awake_island(state: ti.template(), program: ti.template(), island, substeps, h):
    """One fixed step of an island, as fine as it needs. Returns how many of its bodies failed."""
    first, last = state.contact.island_first[island], state.contact.island_first[island + 1]
    for i in range(first, last):
        _begin_body(state, state.contact.island_body[i])
    finer, is_open, age = 1, 1, ti.cast(0.0, ti.f32)
    while is_open == 1:
        is_gentle = _move_island(state, program, island, finer * substeps, h / finer, age)
        most = MOST_PIECES if ti.static(program.integrator == Integrator.IMPLICIT_EULER) else MOST_FINER
        if finer == most or (is_gentle & _island_is_sound(state, island)) == 1:
            is_open = 0
        else:
            _take_back(state, program, island)
            finer *= 2
            age = 1e30  # the candidates are those of where it went
    failed = 0
    for i in range(first, last):
        body = state.contact.island_body[i]
        if state.body_status[body] == ACTIVE:
            if end_body(state, program, body, finer * substeps, h / finer) == 1:
                forget_contacts(state, body)  # it was put back: nothing has touched it
                failed += 1
            elif ti.static(program.integrator == Integrator.IMPLICIT_EULER):
                failed += int(state.body_residual[body] > state.solver[None][0])
        if ti.static(program.has_soft_contact):
            forget_candidates(state, body)
    return failed


@ti.func
def _step_island(state: ti.template(), program: ti.template(), island, substeps, h):
    """One fixed step of one island. Returns how many of its bodies failed, and whether it is awake (1)."""
    failed, is_awake = 0, wake_island(state, island)
    if is_awake == 1:
        failed = _step_awake_island(state, program, island, substeps, h)
        is_awake = settle_island(state, island, substeps * h)
    return failed, is_awake


@ti.func
def _is_to_be_searched(state: ti.template(), body):
    """Whether a body is awake, or will be, and may be touched (1)."""
    found = 0
    if state.body_status[body] != ABSENT:
        island = state.contact.body_island[body]
        if is_social(state, island) == 1:
            for i in range(state.contact.island_first[island], state.contact.island_first[island + 1]):
                found = found | int(state.body_status[state.contact.island_body[i]] == ACTIVE)
    return found


@ti.kernel
def prepare_islands(state: ti.template(), body_count: ti.i32, dt: ti.f32):
    """Find the islands of a step of `dt` [s], and what is near what in them, on all threads.

    A kernel of its own, because a kernel may call one real function only, or Taichi's cache does not find it
    again. What comes nearer within the step is looked for by the island.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        wake_by_colliders(state, body_count)
        find_islands(state, body_count, dt)
    ti.loop_config(block_dim=1)
    for body in range(body_count):
        if _is_to_be_searched(state, body) == 1:
            find_box(state, body)
    ti.loop_config(block_dim=1)
    for body in range(body_count):
        if _is_to_be_searched(state, body) == 1:
            island = state.contact.body_island[body]
            holds, thickness = island_margin(state, island)
            search_body(state, body, island, holds + thickness)


@ti.kernel
def step_islands(
    state: ti.template(), program: ti.template(), body_count: ti.i32, substeps: ti.i32, h: ti.f32
) -> ti.i32:
    """One fixed step of every active body. Returns how many failed, or `ALL_SLEEP`."""
    failed, awake = 0, 0
    if ti.static(not program.has_soft_contact):
        ti.loop_config(serialize=True)
        for _ in range(1):
            wake_by_colliders(state, body_count)
    ti.loop_config(block_dim=1)
    for island in range(state.contact.island_count[None]):
        failed_here, is_awake = _step_island(state, program, island, substeps, h)
        failed += failed_here
        awake += is_awake
    return ti.select(failed + awake == 0, ALL_SLEEP, failed)
