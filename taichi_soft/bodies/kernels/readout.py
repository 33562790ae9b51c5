"""Copy between the fields of a world and the caller's arrays, in the caller's vertex order."""

from taichi_soft.bodies.kernels.origins import choose_origin, exact_position, place_particle, seen_position
from taichi_soft.bodies.kernels.rods import place_frames
from taichi_soft.bodies.status import ABSENT, ACTIVE, DISABLED, PLACED
from taichi_soft.core.math.rows import row_at, row_behind
from taichi_soft.core.runtime import ti


@ti.kernel
def read_positions(
    state: ti.template(),
    alpha: ti.f32,
    is_relative: ti.i32,
    out: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Write positions of all bodies [m], interpolated by `alpha` from the previous step (0) to the last (1).

    The rows of absent bodies in `out` do not change.
    Args: is_relative: see `seen_position`.
    """
    ti.loop_config(serialize=True)
    for body in range(state.capacity.bodies):
        rows = state.body_particles[body]
        if state.body_status[body] != ABSENT:
            for i in range(rows[0], rows[1]):
                x = seen_position(state, state.particle_of_vertex[i], alpha, is_relative)
                for k in ti.static(range(3)):
                    out[i, k] = x[k]


@ti.kernel
def read_exact_positions(state: ti.template(), body: ti.i32, out: ti.types.ndarray(dtype=ti.f64, ndim=2)):
    """Write the positions of one body [m] in float64."""
    ti.loop_config(serialize=True)
    for i in range(out.shape[0]):
        x = exact_position(state, body, state.particle_of_vertex[state.body_particles[body][0] + i])
        for k in ti.static(range(3)):
            out[i, k] = x[k]


@ti.kernel
def read_velocities(
    state: ti.template(), begin: ti.i32, count: ti.i32, out: ti.types.ndarray(dtype=ti.f32, ndim=2)
):
    """Write the velocities of one body [m/s] to `out`, as the integrator stores them."""
    ti.loop_config(serialize=True)
    for i in range(count):
        v = state.particle_velocity[state.particle_of_vertex[begin + i]]
        for k in ti.static(range(3)):
            out[i, k] = v[k]


@ti.kernel
def write_motion(
    state: ti.template(),
    body: ti.i32,
    positions: ti.types.ndarray(ndim=2),
    residues: ti.types.ndarray(ndim=2),
    velocities: ti.types.ndarray(ndim=2),
):
    """Set the positions [m] of one body's particles, and the velocities [m/s] at the same time.

    Args: residues: rounding errors of `positions`.
    """
    choose_origin(state, body, row_at(positions, 0, 0))
    i = 0
    while i < positions.shape[0]:
        p = state.particle_of_vertex[state.body_particles[body][0] + i]
        place_particle(state, body, p, row_at(positions, i, 0), row_at(residues, i, 0))
        state.prev_position[p] = state.particle_position[p]
        v = ti.Vector([velocities[i, 0], velocities[i, 1], velocities[i, 2]])
        state.particle_velocity[p] = v * ti.select(state.particle_inv_mass[p] > 0.0, 1.0, 0.0)
        state.particle_force[p] = ti.Vector.zero(state.real, 4)
        if ti.static(state.capacity.implicit):
            state.particle_contact[p] = 0
        i = row_behind(i)
    if ti.static(state.capacity.rods):
        place_frames(state, body)
    state.body_velocity_lag[body] = 0.0
    state.body_patience[body] = PLACED
    state.body_refinement[body] = 1.0
    state.body_status[body] = ti.select(state.body_status[body] > ABSENT, DISABLED, ACTIVE)
