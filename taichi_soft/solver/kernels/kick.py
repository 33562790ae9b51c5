"""Kick: compute new velocities from forces.

After the kick, joints and contact between bodies change velocities island by island. Then the drift moves the
particles.

Groups of fields: writes islands.
"""

from taichi_soft.bodies.kernels.particles import gravity_on
from taichi_soft.bodies.kernels.rigid import gather_motion
from taichi_soft.contact.kernels.hull_points import update_points
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.solver.step_fields import Job

MAX_VELOCITY_CHANGE = 1.0
"""Largest change of a particle's velocity that forces can cause in one substep, as a multiple of the speed of
sound in its body. After a larger change, the attempt fails. Stable vibrations stay below this limit, even in
slivers: a stable substep is about the time in which sound crosses the smallest tetrahedron."""

TOUCHED_FACTOR = 4.0
"""Factor by which `MAX_VELOCITY_CHANGE` is larger for a particle that touched something in the last substep.
Contact removes most of the change of such a particle."""

EXPLODING = 20.0
"""Largest displacement of a particle in one substep, in mean edge lengths of the surface. If a particle moves
farther, its body counts as exploding. Other bodies pass through an exploding body until it is frozen or
slower."""


@ti.func
def _store_block(state: ti.template(), first, positions: ti.template(), velocities: ti.template()):
    """Store new positions and velocities of `LANES` particles from `first` on, and clear their touches and
    forces.

    There is one loop per field, because a loop of constant length over one field compiles to a few wide
    stores.
    """
    for lane in range(LANES):
        for i in ti.static(range(3)):
            state.particle_position[first + lane][i] = positions[lane, i]
    for lane in range(LANES):
        for i in ti.static(range(3)):
            state.particle_velocity[first + lane][i] = velocities[lane, i]
    for lane in range(LANES):
        state.particle_touches[first + lane] = 0
    for lane in range(LANES):
        state.particle_force[first + lane] = ti.Vector.zero(state.real, 4)


@ti.func
def _store_last_block(
    state: ti.template(), first, count, positions: ti.template(), velocities: ti.template()
):
    """Do the same as `_store_block` for the last block of a body, which has only `count` particles."""
    lane = 0
    while lane < count:
        p = first + lane
        for i in ti.static(range(3)):
            state.particle_position[p][i] = positions[lane, i]
            state.particle_velocity[p][i] = velocities[lane, i]
        state.particle_touches[p] = 0
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        lane = row_behind(lane)


@ti.func
def _store_speeds(state: ti.template(), first, count, common, velocities: ti.template()):
    """Store the speeds of up to `LANES` particles relative to the `common` velocity. Contact reads them.

    Call this before new velocities are stored.

    Returns: for each particle, the square of its possible impact speed.
    """
    speeds, striking2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):
        v = ti.Vector([velocities[lane, i] for i in ti.static(range(3))])
        speeds[lane] = (v - common).norm()
        # Contact removes the speed that a touching particle gains in the kick.
        was_touched = state.particle_touches[first + lane] == 1
        beside = ti.select(was_touched, state.particle_velocity[first + lane], v) - common
        striking2[lane] = ti.select(lane < count, beside.dot(beside), 0.0)
    if count >= LANES:
        for lane in range(LANES):
            state.particle_speed[first + lane] = speeds[lane]
    else:
        lane = 0
        while lane < count:
            state.particle_speed[first + lane] = speeds[lane]
            lane = row_behind(lane)
    return striking2


@ti.func
def _kick_block(state: ti.template(), program: ti.template(), first, count, gravity, kick, job):
    """Compute new velocities and positions of up to `LANES` particles from `first` on.

    Particles move for the job's `drift_time`. Forces are cleared. Rows beyond the last particle are also
    computed, but ignored.

    Returns: for each particle, the squares of its speed, of its possible impact speed, and of its
    acceleration. The acceleration is reduced for touched particles.
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    velocities = ti.Matrix.zero(state.real, LANES, 3)
    speed2, striking2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    acceleration2 = ti.Vector.zero(state.real, LANES)
    # Store only to local arrays. The compiler does not vectorise loops that store to fields, because it
    # cannot know that fields do not overlap.
    for lane in range(LANES):
        p = first + lane
        inv_mass = state.particle_inv_mass[p]
        # Use all four components of a force (the last is 0), for wide loads without gaps.
        acceleration = state.particle_force[p] * inv_mass + widened(gravity)
        acceleration *= ti.select(inv_mass > 0.0, 1.0, 0.0)
        x, v = program.integrator.advance(
            state.particle_position[p], state.particle_velocity[p], acceleration.xyz, job.drift_time, kick
        )
        for i in ti.static(range(3)):
            positions[lane, i] = x[i]
            velocities[lane, i] = v[i]
        speed2[lane] = ti.select(lane < count, v.dot(v), 0.0)
        counts = ti.select(state.particle_touches[p] == 1, 1.0 / TOUCHED_FACTOR**2, 1.0)
        acceleration2[lane] = ti.select(lane < count, counts * acceleration.dot(acceleration), 0.0)
    if ti.static(program.has_soft_contact):
        if job.has_pairs == 1:
            striking2 = _store_speeds(state, first, count, job.velocity, velocities)
    if count >= LANES:
        _store_block(state, first, positions, velocities)
    else:
        _store_last_block(state, first, count, positions, velocities)
    return speed2, striking2, acceleration2


@ti.func
def kick_by_forces(state: ti.template(), program: ti.template(), body, job, kick):
    """Compute velocities after forces act for `kick` [s], and positions after the job's `drift_time`.

    Returns: the highest speed of a particle [m/s]; the highest and the mean possible impact speed, if bodies
        can touch; and 1, or 0 if forces changed a velocity by too much.
    """
    particles, gravity = state.body_particles[body], gravity_on(state, body)
    count = particles[1] - particles[0]
    speed2, striking2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    acceleration2, total2 = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    for block in range((count + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        v2, b2, a2 = _kick_block(state, program, first, particles[1] - first, gravity, kick, job)
        speed2, striking2 = ti.max(speed2, v2), ti.max(striking2, b2)
        acceleration2, total2 = ti.max(acceleration2, a2), total2 + b2
    is_stable = int(kick * ti.sqrt(acceleration2.max()) <= MAX_VELOCITY_CHANGE * state.body_sound_speed[body])
    return ti.sqrt(speed2.max()), ti.sqrt(striking2.max()), ti.sqrt(total2.sum() / count), is_stable


@ti.func
def _store_body_speeds(
    state: ti.template(), program: ti.template(), body, h, speed, beside, mean_beside, is_stable
):
    """Store the speeds of a body for its island and for the search for contacts."""
    # Write a flag only if it has changed. Bodies in adjacent slots share a cache line, and each write takes
    # the line from other threads.
    state.islands.body_speed[body] = speed
    if state.islands.is_stable[body] != is_stable:
        state.islands.is_stable[body] = is_stable
    if ti.static(program.has_soft_contact):
        state.islands.body_speed_beside[body] = beside
        state.islands.body_mean_beside[body] = mean_beside
        is_exploding = int(not (speed * h <= EXPLODING * state.body_edge[body]))
        if state.islands.is_exploding[body] != is_exploding:
            state.islands.is_exploding[body] = is_exploding


@ti.real_func
def kick_body(state: ti.template(), program: ti.template(), body: ti.i32, job: Job, felt: ti.f32) -> ti.i32:
    """Compute new velocities of one body after forces have acted for `felt` [s], and store its speeds.

    Returns: 1, or 0 if forces changed a velocity by too much.
    """
    speed, beside, mean_beside, is_stable = program.integrator.predict(state, program, body, job, felt)
    if ti.static(state.capacity.contact.hull):
        gather_motion(state, body)
        of_points, beside_of_points = update_points(state, body, job.velocity)
        speed, beside = ti.max(speed, of_points), ti.max(beside, beside_of_points)
    _store_body_speeds(state, program, body, job.h, speed, beside, mean_beside, is_stable)
    return is_stable
