"""Features: the vertices and contact edges of a body, in this order.

Groups of fields: reads hull, soft.
"""

from taichi_soft.contact.fields import SLOTS
from taichi_soft.core.runtime import ti


@ti.func
def first_feature(state: ti.template(), body):
    """Return the row of a body's first feature."""
    return state.touching.body_outer[body][0] + state.soft.body_edges[body][0]


@ti.func
def first_edge_feature(state: ti.template(), body):
    """Return the row of the feature that is a body's first contact edge."""
    return state.touching.body_outer[body][1] + state.soft.body_edges[body][0]


@ti.func
def end_feature(state: ti.template(), body):
    """Return the row after a body's last feature."""
    return state.touching.body_outer[body][1] + state.soft.body_edges[body][1]


@ti.func
def first_slot_of(state: ti.template(), body):
    """Return the row of a body's first slot."""
    return first_feature(state, body) * SLOTS


@ti.func
def vertex_of(state: ti.template(), body, feature):
    """Return the particle or hull point of a feature that is a vertex."""
    return state.touching.outer_particle[feature - state.soft.body_edges[body][0]]


@ti.func
def edge_of(state: ti.template(), body, feature):
    """Return the row of a contact edge, for a feature that is one."""
    return feature - state.touching.body_outer[body][1]


@ti.func
def feature_position(state: ti.template(), body, feature):
    """Return the position of a vertex, or of the middle of an edge [m]."""
    x = ti.Vector.zero(ti.f32, 3)
    if feature < first_edge_feature(state, body):
        x = state.particle_position[vertex_of(state, body, feature)]
    else:
        ends = state.soft.edge_corners[edge_of(state, body, feature)].xy
        x = 0.5 * (state.particle_position[ends[0]] + state.particle_position[ends[1]])
    return x
