"""Evaluation without motion: forces of a world's body, and of any mesh in any precision."""

from taichi_soft.constants import LANES
from taichi_soft.kernels.damping import accumulate_edge_damping
from taichi_soft.kernels.elastic import lane_forces
from taichi_soft.kernels.motion import particle_is_sound, restore_particle
from taichi_soft.kernels.per_body import move_body
from taichi_soft.laws.damping import edge_damping_force, tet_mean_damping_forces
from taichi_soft.laws.model import flipped_forces, upright_forces
from taichi_soft.math.finite import is_finite
from taichi_soft.runtime import ti
from taichi_soft.types import DampingModel


@ti.func
def accumulate_forces_one_by_one(state: ti.template(), program: ti.template(), body):
    """Add all internal forces of one body to its particles, tetrahedron by tetrahedron.

    Returns the first tetrahedron (block times `LANES` plus lane) with a corner out of reach or a force that
    is not finite, or -1.
    """
    broken = -1
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            blocks = state.body_blocks[body]
            for t in range(blocks[0] * LANES, blocks[1] * LANES):
                block, lane = t // LANES, t % LANES
                forces = lane_forces(state, model, block, lane)
                for corner in ti.static(range(4)):
                    p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
                    if broken < 0 and (particle_is_sound(state, p) & is_finite(forces[corner])) == 0:
                        broken = t
                    state.particle_force[p] = state.particle_force[p] + forces[corner]
    accumulate_edge_damping(state, body)
    return broken


@ti.kernel
def compute_body_forces(
    state: ti.template(), program: ti.template(), body: ti.i32, out: ti.types.ndarray(dtype=ti.f32, ndim=2)
):
    """Internal forces on the particles of one body where they are now [N], in kernel order."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        accumulate_forces_one_by_one(state, program, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            for i in ti.static(range(3)):
                out[p - particles[0], i] = state.particle_force[p][i]
            state.particle_force[p] = ti.Vector([0.0, 0.0, 0.0])


@ti.kernel
def find_failure(
    state: ti.template(),
    program: ti.template(),
    body: ti.i32,
    substeps: ti.i32,
    h: ti.f32,
    found: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Make the last step of a frozen body again, up to the substep in which it breaks, and undo it.

    Args:
        found: receives the tetrahedron that broke first (block times `LANES` plus lane) and the substep;
            left alone where nothing breaks.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        kick = 0.5 * (state.body_velocity_lag[body] + h)
        is_open = 1
        for s in range(substeps + 1):
            if is_open == 1:
                broken = accumulate_forces_one_by_one(state, program, body)
                if broken >= 0:
                    found[0] = broken
                    found[1] = s
                    is_open = 0
                else:
                    move_body(state, program, body, h, kick)
                    kick = h
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            restore_particle(state, p)
            state.particle_force[p] = ti.Vector([0.0, 0.0, 0.0])


@ti.func
def _vec3(rows: ti.template(), i):
    return ti.Vector([rows[i, 0], rows[i, 1], rows[i, 2]])


@ti.func
def _add(rows: ti.template(), i, v):
    for k in ti.static(range(3)):
        rows[i, k] = rows[i, k] + v[k]


@ti.kernel
def evaluate_tet_forces(
    model: ti.template(),
    positions: ti.types.ndarray(ndim=2),
    velocities: ti.types.ndarray(ndim=2),
    tets: ti.types.ndarray(dtype=ti.i32, ndim=2),
    rest_inverse: ti.types.ndarray(ndim=3),
    lame: ti.types.ndarray(ndim=2),
    damping: ti.types.ndarray(ndim=1),
    out: ti.types.ndarray(ndim=2),
):
    """Add the forces of every tetrahedron to `out` (n, 3) [N], in the precision of the arrays."""
    ti.loop_config(serialize=True)
    for t in range(tets.shape[0]):
        p0, p1, p2, p3 = tets[t, 0], tets[t, 1], tets[t, 2], tets[t, 3]
        x0, x1, x2, x3 = (
            _vec3(positions, p0),
            _vec3(positions, p1),
            _vec3(positions, p2),
            _vec3(positions, p3),
        )
        inverse = (
            ti.Vector([rest_inverse[t, 0, 0], rest_inverse[t, 1, 0], rest_inverse[t, 2, 0]]),
            ti.Vector([rest_inverse[t, 0, 1], rest_inverse[t, 1, 1], rest_inverse[t, 2, 1]]),
            ti.Vector([rest_inverse[t, 0, 2], rest_inverse[t, 1, 2], rest_inverse[t, 2, 2]]),
        )
        f0, f1, f2, f3, volume6 = upright_forces(model, x0, x1, x2, x3, inverse, lame[t, 0], lame[t, 1])
        if ti.static(model.repairs_flips):
            if volume6 < 0.0:
                f0, f1, f2, f3 = flipped_forces(model, x0, x1, x2, x3, inverse, lame[t, 0], lame[t, 1])
        if ti.static(model.damping_model == DampingModel.TET_MEAN):
            d0, d1, d2, d3 = tet_mean_damping_forces(
                _vec3(velocities, p0),
                _vec3(velocities, p1),
                _vec3(velocities, p2),
                _vec3(velocities, p3),
                damping[t],
            )
            f0, f1, f2, f3 = f0 + d0, f1 + d1, f2 + d2, f3 + d3
        _add(out, p0, f0)
        _add(out, p1, f1)
        _add(out, p2, f2)
        _add(out, p3, f3)


@ti.kernel
def evaluate_edge_damping(
    positions: ti.types.ndarray(ndim=2),
    velocities: ti.types.ndarray(ndim=2),
    edges: ti.types.ndarray(dtype=ti.i32, ndim=2),
    damping: ti.types.ndarray(ndim=1),
    out: ti.types.ndarray(ndim=2),
):
    """Add the damping of every edge to `out` (n, 3) [N], in the precision of the arrays."""
    ti.loop_config(serialize=True)
    for e in range(edges.shape[0]):
        p, q = edges[e, 0], edges[e, 1]
        r = _vec3(positions, q) - _vec3(positions, p)
        force = edge_damping_force(r, _vec3(velocities, q) - _vec3(velocities, p), damping[e])
        _add(out, p, force)
        _add(out, q, -force)
