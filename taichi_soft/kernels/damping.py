"""Damping along edges: loads values, calls the law, stores forces."""

from taichi_soft.laws.damping import edge_damping_force
from taichi_soft.runtime import ti


@ti.func
def edge_force_of(state: ti.template(), e):
    """Damping force on the first end of edge `e` [N]."""
    p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
    return edge_damping_force(
        state.particle_position[q] - state.particle_position[p],
        state.particle_velocity[q] - state.particle_velocity[p],
        state.edge_damping[e],
    )


@ti.func
def accumulate_edge_damping(state: ti.template(), body):
    """Add the damping of all edges of one body to its particles, in one thread."""
    edges = state.body_edges[body]
    for e in range(edges[0], edges[1]):
        p, q = state.edge_vertices[e][0], state.edge_vertices[e][1]
        force = edge_force_of(state, e)
        state.particle_force[p] = state.particle_force[p] + force
        state.particle_force[q] = state.particle_force[q] - force
