"""Evaluation without motion: forces on a body where it is, or would be."""

from taichi_soft.bodies.kernels.particles import particle_is_sound
from taichi_soft.core.constants import LANES
from taichi_soft.core.math.finite import is_finite
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.bonds import accumulate_pressures
from taichi_soft.elements.kernels.edges import accumulate_edge_forces, edge_force_of
from taichi_soft.elements.kernels.elastic import lane_forces


@ti.func
def _add_tet_forces(state: ti.template(), model: ti.template(), body):
    """Returns the first broken tetrahedron (block times `LANES` plus lane) or -1."""
    broken = -1
    blocks = state.body_blocks[body]
    for t in range(blocks[0] * LANES, blocks[1] * LANES):
        block, lane = t // LANES, t % LANES
        forces = lane_forces(state, model, block, lane)
        for corner in ti.static(range(4)):
            p = state.tet_vertices[(block * 4 + corner) * LANES + lane]
            if broken < 0 and (particle_is_sound(state, p) & is_finite(forces[corner])) == 0:
                broken = t
            state.particle_force[p] = state.particle_force[p] + widened(forces[corner])
    accumulate_edge_forces(state, model, body)
    return broken


@ti.func
def _add_bond_forces(state: ti.template(), model: ti.template(), body):
    """Returns the first broken edge or -1."""
    broken = -1
    if ti.static(model.reads_expansion):
        accumulate_pressures(state, body)
    accumulate_edge_forces(state, model, body)
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        sound = particle_is_sound(state, p) & particle_is_sound(state, q)
        if broken < 0 and (sound & is_finite(edge_force_of(state, model, e))) == 0:
            broken = e
    return broken


@ti.func
def accumulate_forces_one_by_one(state: ti.template(), program: ti.template(), body):
    """Add all internal forces of one body to its particles, element by element.

    Returns the first tetrahedron (block times `LANES` plus lane), or edge where forces act along edges, with
    an end out of reach or a force that is not finite, or -1.
    """
    broken = -1
    for m, model in ti.static(enumerate(program.models)):
        if state.body_model[body] == m:
            if ti.static(model.has_bonds):
                broken = _add_bond_forces(state, model, body)
            else:
                broken = _add_tet_forces(state, model, body)
    return broken


@ti.kernel
def compute_body_forces(
    state: ti.template(), program: ti.template(), body: ti.i32, out: ti.types.ndarray(ndim=2)
):
    """Internal forces on the particles of one body where they are now [N], in kernel order."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        accumulate_forces_one_by_one(state, program, body)
        particles = state.body_particles[body]
        for p in range(particles[0], particles[1]):
            for i in ti.static(range(3)):
                out[p - particles[0], i] = state.particle_force[p][i]
            state.particle_force[p] = ti.Vector.zero(state.real, 4)
