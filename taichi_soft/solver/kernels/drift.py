"""Drift among colliders: new positions from velocities, and what colliders in the way make of both."""

from taichi_soft.contact.kernels.collide import collided, find_near_colliders
from taichi_soft.contact.kernels.hull import has_hull, place_points
from taichi_soft.contact.kernels.hull_colliders import collide_points, forget_held
from taichi_soft.contact.kernels.rebound import limit_rebounds
from taichi_soft.core.constants import LANES, ROW_BITS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti
from taichi_soft.solver.kernels.sleep import note_motion
from taichi_soft.solver.step_fields import Job


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
        p = particles[0]
        while p < particles[1]:
            state.particle_position[p] = state.particle_position[p] - h * state.particle_velocity[p]
            p = row_behind(p)
    return clear


@ti.func
def _drift_block(state: ti.template(), body, first, count, h, since, gone):
    """New positions of up to `LANES` particles from `first` on, one by one of those that may meet a collider.

    Returns: the square of the way of each [m^2].
    """
    positions = ti.Matrix.zero(state.real, LANES, 3)
    meets_none = state.contact.near_count[body] == 0
    way2, passes = ti.Vector.zero(state.real, LANES), ti.Vector.zero(state.real, LANES)
    for lane in range(LANES):
        p = first + lane
        way = h * state.particle_velocity[p]
        x = state.particle_position[p] + way
        is_far = meets_none or state.contact.particle_clearance[p] > gone or state.particle_inv_mass[p] <= 0.0
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


@ti.real_func
def drift_body(state: ti.template(), body: ti.i32, job: Job):
    """New positions of one body, and what colliders in the way make of velocities."""
    h, since = job.h, job.since
    gone = state.contact.gone[body] + job.fastest * h
    is_new = int(not (state.contact.reach[body] >= gone))
    if is_new == 1:
        # A quarter more than the rest of the step needs at this speed.
        place_points(state, body)
        find_near_colliders(state, body, 1.25 * job.fastest * job.left + 1e-3, since, job.left)
        gone = job.fastest * h
    state.contact.gone[body] = gone
    if ti.static(state.capacity.contact.hull):
        if state.contact.near_count[body] > 0:
            collide_points(state, body, h, since, gone)
        elif is_new == 1:
            forget_held(state, body)
    particles = state.body_particles[body]
    way2 = ti.Vector.zero(state.real, LANES)
    for block in range((particles[1] - particles[0] + LANES - 1) // LANES):
        first = (particles[0] + block * LANES) & ROW_BITS
        way2 = ti.max(way2, _drift_block(state, body, first, particles[1] - first, h, since, gone))
    place_points(state, body)
    limit_rebounds(state, body, since + h)
    if ti.static(state.capacity.contact.hull):
        if not has_hull(state, body):  # it is looked at after the step: see `note_way_of_hulled`
            note_motion(state, body, ti.sqrt(way2.max()) / h)
    else:
        note_motion(state, body, ti.sqrt(way2.max()) / h)
