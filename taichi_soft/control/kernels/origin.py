"""Move all places of a world to another origin, between two steps.

Differences are computed in float64 and rounded once, so that a shift is exact where float32 has the result.

Groups of fields: writes grabs, motors.
"""

from taichi_soft.bodies.kernels.origins import exact_position, origin_near, place_exactly, residue_of
from taichi_soft.bodies.kernels.rigid import shift_pose
from taichi_soft.bodies.status import ABSENT, TO_TARGET
from taichi_soft.control.kernels.grabs import MOST_GRABS
from taichi_soft.control.kernels.motors import MOST_MOTORS
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.runtime import ti


@ti.func
def _shifted(x, offset):
    return ti.cast(ti.cast(x, ti.f64) - offset, ti.f32)


@ti.kernel
def shift_places(
    state: ti.template(),
    shifts: ti.i32,
    offset: ti.types.ndarray(dtype=ti.f64, ndim=1),
    farthest: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    """Subtract an offset from all places, or measure how far from the origin they would be.

    Args:
        shifts: 1 to shift, 0 to measure only.
        offset: new origin in the old coordinates, (3,) [m].
        farthest: receives the largest coordinate of a particle after the shift [m], (1,), if `shifts` is 0.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        move = ti.Vector([offset[0], offset[1], offset[2]])
        largest = ti.cast(0.0, ti.f64)
        body = 0
        while body < state.capacity.bodies:
            p, end = state.body_particles[body][0], state.body_particles[body][1]
            if state.body_status[body] == ABSENT:
                end = p
            first = ti.cast(exact_position(state, body, p) - move, ti.f32)
            origin = origin_near(first, ti.Vector.zero(ti.f32, 3))
            to_local = move + ti.cast(origin, ti.f64) - ti.cast(state.body_origin[body], ti.f64)
            while p < end:
                x = exact_position(state, body, p) - move
                if shifts == 1:
                    place_exactly(state, p, x, origin)
                    state.prev_position[p] = _shifted(state.prev_position[p], move)
                    if state.particle_aim[p] == TO_TARGET:
                        state.particle_target[p] = _shifted(state.particle_target[p], to_local)
                else:
                    largest = ti.max(largest, ti.abs(x).max())
                p = row_behind(p)
            if shifts == 1:
                if ti.static(state.capacity.has_rigid):
                    shift_pose(state, body, -to_local, 0)
                state.body_origin[body] = origin
                for corner in ti.static((state.body_bounds_lower, state.body_bounds_upper)):
                    corner[body] = _shifted(corner[body], move)
            body = row_behind(body)
        if shifts == 1:
            g, m = 0, 0
            while g < MOST_GRABS:
                if state.grabs.body[g] > 0:
                    before = ti.cast(state.grabs.target[g], ti.f64)
                    place = before + ti.cast(state.grabs.residue[g], ti.f64) - move
                    state.grabs.target[g] = ti.cast(place, ti.f32)
                    residue = ti.cast(place - ti.cast(state.grabs.target[g], ti.f64), ti.f32)
                    state.grabs.residue[g] = residue_of(state.grabs.target[g], residue)
                g = row_behind(g)
            while m < MOST_MOTORS:
                row = state.motors.motor[m]
                if row.body > 0 and row.has_point == 1:
                    row.point = _shifted(row.point, move)
                    state.motors.motor[m] = row
                m = row_behind(m)
        else:
            farthest[0] = largest
