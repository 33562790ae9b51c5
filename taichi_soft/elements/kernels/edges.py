"""Forces between the two ends of each edge, by pairwise laws or by damping alone."""

from taichi_soft.core.constants import HALF, LANES, ROW_BITS
from taichi_soft.core.math.tensors import widened
from taichi_soft.core.runtime import ti
from taichi_soft.elements.kernels.bonds import bond_force_of, ring_tension
from taichi_soft.elements.laws.damping import edge_damping_force
from taichi_soft.elements.laws.springs import damped_pull, spring_tension


@ti.func
def _simple_force(state: ti.template(), model: ti.template(), e, r, relative_velocity, tension):
    """Sum of the spring force, an additional `tension` [N] and the damping on the first end of an edge [N].

    For laws without bonds, the force contains only the damping.
    """
    if ti.static(model.has_bonds):
        pull = spring_tension(r, state.edge_bond[e]) + tension
        return damped_pull(r, relative_velocity, pull, state.edge_damping[e])
    else:
        return edge_damping_force(r, relative_velocity, state.edge_damping[e])


@ti.func
def edge_force_of(state: ti.template(), model: ti.template(), e):
    """Force on the first end of edge `e` [N]; the opposite force acts on the second end."""
    if ti.static(model.has_simple_edges):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        tension = state.edge_damping[e] * 0.0
        if ti.static(model.reads_expansion):
            tension = ring_tension(state, e)
        return _simple_force(
            state,
            model,
            e,
            state.particle_position[q] - state.particle_position[p],
            state.particle_velocity[q] - state.particle_velocity[p],
            tension,
        )
    else:
        return bond_force_of(state, model.law, e)


@ti.func
def _accumulate_block(state: ti.template(), model: ti.template(), first, count):
    """Add the forces of a block of up to `LANES` edges to the particles, vectorised as in `elastic`.

    All edges in a half of the block have the same first end. If the block has fewer than `LANES` edges, this
    function also computes the forces of the next rows, which belong to the same body or are spare. These
    forces are discarded.
    """
    p = state.edge_vertices[first][0]
    p_later = state.edge_vertices[first + ti.select(count > HALF, HALF, 0)][0]
    x, v = state.particle_position[p], state.particle_velocity[p]
    x_later, v_later = state.particle_position[p_later], state.particle_velocity[p_later]
    forces = ti.Matrix.zero(state.real, LANES, 4)
    for lane in range(LANES):
        e = first + lane
        q = state.edge_vertices[e][1]
        tension = state.edge_damping[e] * 0.0
        if ti.static(model.reads_expansion):
            tension = state.edge_pressure[e] * state.edge_bond[e].z
        r = state.particle_position[q] - ti.select(lane < HALF, x, x_later)
        relative_velocity = state.particle_velocity[q] - ti.select(lane < HALF, v, v_later)
        force = _simple_force(state, model, e, r, relative_velocity, tension)
        for i in ti.static(range(3)):
            forces[lane, i] = ti.select(lane < count, force[i], 0.0)
        forces[lane, 3] = 0.0  # gaps in the rows would prevent vector stores
    for half in ti.static(range(2)):
        total = ti.Vector.zero(state.real, 4)
        for i in range(HALF):
            lane = half * HALF + i
            q = state.edge_vertices[first + lane][1]
            force = ti.Vector([forces[lane, axis] for axis in ti.static(range(4))])
            total += force
            # No `+=`: Taichi would make it atomic, although only one thread owns the body.
            state.particle_force[q] = state.particle_force[q] - force
        first_end = (p, p_later)[half]
        state.particle_force[first_end] = state.particle_force[first_end] + total


@ti.func
def accumulate_edge_forces(state: ti.template(), model: ti.template(), body):
    """Add the forces of all edges of one body to its particles, in one thread."""
    if ti.static(model.has_simple_edges):
        blocks = state.body_edge_blocks[body]
        for block in range(blocks[0], blocks[1]):
            first = state.edge_blocks[block][0] & ROW_BITS
            _accumulate_block(state, model, first, state.edge_blocks[block][1])
    else:
        edges = state.body_edges[body]
        for e in range(edges[0], edges[1]):
            p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
            force = widened(bond_force_of(state, model.law, e))
            state.particle_force[p] = state.particle_force[p] + force
            state.particle_force[q] = state.particle_force[q] - force
