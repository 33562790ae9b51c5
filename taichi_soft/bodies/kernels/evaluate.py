"""Evaluate forces on a body at given positions, without motion."""

from taichi_soft.bodies.kernels.origins import enter_local, leave_local
from taichi_soft.bodies.kernels.particles import particle_is_valid
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.bonds import accumulate_pressures
from taichi_soft.elements.kernels.edges import accumulate_edge_forces, edge_force_of
from taichi_soft.elements.kernels.elastic import lane_forces
from taichi_soft.elements.kernels.rods import accumulate_rod_forces
from taichi_soft.elements.kernels.shells import accumulate_shell_forces, shell_forces_of
from taichi_soft.elements.laws.shell import POINTS


@ti.func
def _add_tet_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of tetrahedra. Return the first tetrahedron that failed, or -1.

    The number of a tetrahedron is block times `LANES` plus lane.
    """
    failed, origin = -1, state.body_origin[body]
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        forces = lane_forces(state, model, block, lane)
        for corner in ti.static(range(4)):
            p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
            if failed < 0 and (particle_is_valid(state, p, origin) & is_finite(forces[corner])) == 0:
                failed = t
            state.particle_force[p] = state.particle_force[p] + widened(forces[corner])
    accumulate_edge_forces(state, model, body)
    return failed


@ti.func
def _add_bond_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of bonds. Return the first edge that failed, or -1."""
    failed, origin = -1, state.body_origin[body]
    if ti.static(model.reads_expansion):
        accumulate_pressures(state, body)
    accumulate_edge_forces(state, model, body)
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        valid = particle_is_valid(state, p, origin) & particle_is_valid(state, q, origin)
        if failed < 0 and (valid & is_finite(edge_force_of(state, model, e))) == 0:
            failed = e
    return failed


@ti.func
def _add_shell_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of a shell. Return the first triangle that failed, or -1.

    The number of a triangle is block times `LANES` plus lane.
    """
    failed, origin = -1, state.body_origin[body]
    accumulate_shell_forces(state, body)
    accumulate_edge_forces(state, model, body)
    blocks = state.body_shells[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        valid = 1
        for k in ti.static(range(POINTS)):
            p = state.shell_points[(block * POINTS + k) * LANES + lane]
            valid = valid & particle_is_valid(state, p, origin)
        forces = shell_forces_of(state, block, lane)
        for k in ti.static(range(POINTS - 1)):
            valid = valid & is_finite(forces[k])
        if failed < 0 and valid == 0:
            failed = t
    return failed


@ti.func
def _add_rod_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of a rod. Return the first edge that failed, as the particle at its first end, or -1."""
    failed = -1
    accumulate_rod_forces(state, body)
    accumulate_edge_forces(state, model, body)
    particles = state.body_particles[body]
    for p in range(particles[0], particles[1]):
        force = state.particle_force[p].xyz
        if failed < 0 and (particle_is_valid(state, p, state.body_origin[body]) & is_finite(force)) == 0:
            failed = p
    return failed


@ti.func
def accumulate_forces_one_by_one(state: ti.template(), program: ti.template(), body):
    """Add all internal forces of one body to its particles, element by element.

    Returns: the first element that failed, or -1. An element fails if one of its particles is out of range or
        its force is not finite. For a law along edges, the result is an edge; for a rod it is the particle
        at the first end of an edge. For a shell it is a triangle, and for other laws a tetrahedron, as block
        times `LANES` plus lane.
    """
    failed = -1
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.is_shell):
                failed = _add_shell_forces(state, model, body)
            elif ti.static(model.is_rod):
                failed = _add_rod_forces(state, model, body)
            elif ti.static(model.has_bonds):
                failed = _add_bond_forces(state, model, body)
            else:
                failed = _add_tet_forces(state, model, body)
    return failed


@ti.kernel
def compute_body_forces(
    state: ti.template(), program: ti.template(), body: ti.i32, out: ti.types.ndarray(ndim=2)
):
    """Write the current internal forces on the particles of one body, (n, 3) [N], in kernel order."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        enter_local(state, body, state.body_origin[body])
        accumulate_forces_one_by_one(state, program, body)
        leave_local(state, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            for i in ti.static(range(3)):
                out[p - particles[0], i] = state.particle_force[p][i]
            state.particle_force[p] = ti.Vector.zero(state.real, 4)
