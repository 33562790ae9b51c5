"""Save and restore bodies in attempts at a step, and decide whether an attempt had short enough substeps.

The number of substeps is chosen for small deformation, and raised for bodies that are stiffer than at rest.
An impact faster than sound flattens tetrahedra, which makes them stiffer. An attempt fails if forces in one
substep change a velocity by more than `MAX_VELOCITY_CHANGE`, or if the result is not finite. The island is
then restored, and the step is retried with twice as many substeps. The last attempt damps vibrations
strongly, but conserves momentum and angular momentum.

Groups of fields: reads hull; writes islands.
"""

from taichi_soft.bodies.kernels.particles import particle_is_valid, restore_particle, save_particle
from taichi_soft.bodies.kernels.rigid import begin_rigid, restore_rigid
from taichi_soft.bodies.kernels.rods import restore_frames, save_frames
from taichi_soft.bodies.status import ABSENT, ACTIVE, FEELS_REACTION, FROZEN
from taichi_soft.contact.kernels.candidates import clear_candidates
from taichi_soft.contact.kernels.collide import clear_contacts
from taichi_soft.contact.kernels.hull_colliders import clear_warm_start, clear_warm_start_if_free
from taichi_soft.contact.kernels.hull_points import place_points
from taichi_soft.contact.kernels.rebound import begin_rebounds, restore_rebounds
from taichi_soft.contact.kernels.touches import clear_touches
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.internal_forces import clear_forces
from taichi_soft.solver.kernels.untangling import MAX_REFINEMENT


@ti.func
def attempts_of(state: ti.template(), program: ti.template()):
    """Return how often the substep can be halved, and the number of the last attempt.

    If the two numbers differ, the last attempt keeps the substeps of the attempt before it and adds strong
    damping.
    """
    halvings = state.retries[None]
    last = ti.select(halvings > 0, halvings + 1, 0)
    if ti.static(program.integrator.halvings > 0):
        halvings = last = program.integrator.halvings
    return halvings, last


@ti.func
def refined_substeps(state: ti.template(), program: ti.template(), island, substeps, dt):
    """Return the number of substeps for the first attempt at a step of `dt` [s]: `substeps`, or more if the
    shapes of the island's bodies require more.
    """
    least = ti.cast(substeps, ti.f32)
    if ti.static(program.integrator.has_stable_step):
        if state.retries[None] > 0:
            first, end = state.islands.first[island], state.islands.first[island + 1]
            row = first
            while row < end:
                body = state.islands.body[row]
                if state.body_status[body] == ACTIVE and state.body_refinement[body] > 1.0:
                    at_rest = dt * state.body_sound_speed[body] / state.body_stride[body]
                    # Limit the refinement, because a forged snapshot can contain any number.
                    refinement = ti.min(state.body_refinement[body], MAX_REFINEMENT)
                    least = ti.max(least, ti.min(at_rest * refinement, MAX_REFINEMENT * substeps))
                row = row_behind(row)
    return ti.cast(ti.ceil(least), ti.i32)


@ti.real_func
def begin_body(state: ti.template(), program: ti.template(), body: ti.i32):
    """Save the state of a body before the step, for interpolation and retries, and clear the contacts
    of the last step.
    """
    if state.body_status[body] != ABSENT:
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            save_particle(state, p)
        if ti.static(state.capacity.rods):
            save_frames(state, body)
        if state.body_drives[body] & FEELS_REACTION != 0:
            for p in range(particles[0], particles[1]):
                if state.body_status[body] == FROZEN:  # `aim_pinned` skips frozen bodies
                    state.particle_reaction[p] = ti.Vector.zero(state.real, 3)
                state.prev_reaction[p] = state.particle_reaction[p]
        _begin_contacts(state, program, body)


@ti.func
def _begin_contacts(state: ti.template(), program: ti.template(), body):
    particles = state.body_particles[body]
    if ti.static(state.capacity.implicit):
        for p in range(particles[0], particles[1]):
            state.prev_contact[p] = state.particle_contact[p]
    begin_rebounds(state, body)
    begin_rigid(state, body)
    if ti.static(state.capacity.contact.hull):
        clear_warm_start_if_free(state, body)
    clear_contacts(state, body)
    state.islands.is_exploding[body] = 0
    if ti.static(program.has_soft_contact):
        if state.body_status[body] != ACTIVE:
            state.islands.body_speed_beside[body] = 0.0
            for p in range(particles[0], particles[1]):
                state.particle_speed[p] = 0.0
            if ti.static(state.capacity.contact.hull):
                place_points(state, body)
                for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
                    state.particle_speed[p] = 0.0


@ti.func
def _restore_body(state: ti.template(), program: ti.template(), body):
    """Restore the state that a body had before the step."""
    state.body_jolted[body] = 1
    particles = state.body_particles[body]
    p = particles[0]
    while p < particles[1]:
        restore_particle(state, p)
        if state.body_drives[body] & FEELS_REACTION != 0:
            state.particle_reaction[p] = state.prev_reaction[p]
        if ti.static(state.capacity.implicit):
            state.particle_contact[p] = state.prev_contact[p]
        p = row_behind(p)
    restore_rigid(state, body)
    if ti.static(state.capacity.rods):
        restore_frames(state, body)
    clear_forces(state, body)
    restore_rebounds(state, body)
    clear_contacts(state, body)
    if ti.static(state.capacity.contact.hull):
        clear_warm_start(state, body)
    if ti.static(program.has_soft_contact):
        clear_candidates(state, body)  # the island searches for contacts again before it continues


@ti.real_func
def restore_island(state: ti.template(), program: ti.template(), island: ti.i32):
    """Restore the state that an island had before the step."""
    first, end = state.islands.first[island], state.islands.first[island + 1]
    for row in range(first, end):
        _restore_body(state, program, state.islands.body[row])
    if ti.static(program.has_soft_contact):
        clear_touches(state, island)


@ti.func
def set_strong_damping(state: ti.template(), island, is_braked):
    """Turn strong damping of vibrations on (1) or off (0) for all bodies of an island."""
    first, end = state.islands.first[island], state.islands.first[island + 1]
    row = first
    while row < end:
        state.body_is_braked[state.islands.body[row]] = is_braked
        row = row_behind(row)


@ti.func
def body_is_valid(state: ti.template(), body):
    """Return 1 if all particles of a body have valid positions and velocities."""
    particles, broken = state.body_particles[body], ti.Vector.zero(ti.i32, LANES)
    origin = state.body_origin[body]
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        for lane in range(LANES):
            is_valid = particle_is_valid(state, first + lane, origin)
            is_broken = int(first + lane < particles[1]) & (1 - is_valid)
            broken[lane] = broken[lane] | is_broken
    return 1 - broken.max()


@ti.func
def island_is_valid(state: ti.template(), island):
    """Return 1 if all active bodies of an island are valid."""
    sound = 1
    first, end = state.islands.first[island], state.islands.first[island + 1]
    for row in range(first, end):
        body = state.islands.body[row]
        if state.body_status[body] == ACTIVE:
            sound = sound & body_is_valid(state, body)
    return sound
