"""Forces between the two ends of each edge, of pairwise laws or of damping alone: loads, calls, stores.

As in `elastic`, edges that look at nothing but their ends run in blocks of `LANES`, whose loop reads fields
and writes local arrays only, so that LLVM makes vector instructions of it.
"""

from taichi_soft.constants import LANES
from taichi_soft.kernels.bonds import bond_force_of, spring_force_of
from taichi_soft.laws.damping import edge_damping_force
from taichi_soft.runtime import ti

EDGE_BITS = (1 << 28) - 1
"""Mask that leaves every edge number unchanged, and shows that their sums do not overflow."""


@ti.func
def damping_force_of(state: ti.template(), e):
    """Damping force on the first end of edge `e` [N]."""
    p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
    return edge_damping_force(
        state.particle_position[q] - state.particle_position[p],
        state.particle_velocity[q] - state.particle_velocity[p],
        state.edge_damping[e],
    )


@ti.func
def edge_force_of(state: ti.template(), model: ti.template(), e):
    """Force on the first end of edge `e` [N]; the second feels the opposite."""
    if ti.static(model.has_bonds):
        return bond_force_of(state, model.law, e)
    else:
        return damping_force_of(state, e)


@ti.func
def _simple_force_of(state: ti.template(), model: ti.template(), e):
    """As `edge_force_of`, with the pull of volumes already in `edge_tension`."""
    if ti.static(model.reads_expansion):
        return spring_force_of(state, e, state.edge_tension[e])
    else:
        return edge_force_of(state, model, e)


@ti.func
def _add_to_ends(state: ti.template(), e, force):
    p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
    # Not `+=`, which Taichi makes atomic: one thread owns the body.
    state.particle_force[p] = state.particle_force[p] + force
    state.particle_force[q] = state.particle_force[q] - force


@ti.func
def _accumulate_in_blocks(state: ti.template(), model: ti.template(), begin, end):
    blocks = (end - begin) // LANES
    for block in range(blocks):
        first = (begin + block * LANES) & EDGE_BITS
        forces = ti.Matrix.zero(state.real, 3, LANES)
        for lane in range(LANES):
            force = _simple_force_of(state, model, first + lane)
            for i in ti.static(range(3)):
                forces[i, lane] = force[i]
        for lane in range(LANES):
            force = ti.Vector([forces[i, lane] for i in ti.static(range(3))])
            _add_to_ends(state, first + lane, force)
    for e in range(begin + blocks * LANES, end):
        _add_to_ends(state, e, _simple_force_of(state, model, e))


@ti.func
def accumulate_edge_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of all edges of one body to its particles, in one thread."""
    edges = state.body_edges[body]
    if ti.static(model.has_simple_edges):
        _accumulate_in_blocks(state, model, edges[0], edges[1])
    else:
        for e in range(edges[0], edges[1]):
            _add_to_ends(state, e, bond_force_of(state, model.law, e))
