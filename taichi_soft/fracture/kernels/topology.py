"""Kernels that read the motion of a body, and write a body with its motion into a slot.

Groups of fields: writes colliders, hull, soft.
"""

from taichi_soft.bodies.kernels.origins import local_position, place_local
from taichi_soft.contact.fields import NO_CONTACT
from taichi_soft.contact.kernels.candidates import clear_kept_impulses
from taichi_soft.core.constants import LANES
from taichi_soft.core.runtime import ti

MOTION_WIDTH = 26
"""Number of columns of `read_motion`. The columns are, in this order: position relative to the body's origin,
velocity, both before the last step, inverse mass, collider contact, touch, mass, aim, target, external force,
reaction."""


@ti.func
def _three(rows: ti.template(), i, first):
    return ti.Vector([rows[i, first], rows[i, first + 1], rows[i, first + 2]])


@ti.kernel
def read_motion(state: ti.template(), body: ti.i32, out: ti.types.ndarray(dtype=ti.f32, ndim=2)):
    """Read the state of a body's particles into `out`, (n, MOTION_WIDTH), in the caller's vertex order."""
    ti.loop_config(serialize=True)
    for i in range(out.shape[0]):
        p = state.particle_of_vertex[state.body_particles[body][0] + i]
        x, earlier = state.particle_position[p], state.prev_position[p]
        if (state.body_origin[body] != 0.0).any():
            x, earlier = local_position(state, body, p), earlier - state.body_origin[body]
        for k in ti.static(range(3)):
            out[i, k] = x[k]
            out[i, 6 + k] = earlier[k]
        for k in range(3):
            out[i, 3 + k] = state.particle_velocity[p][k]
            out[i, 9 + k] = state.prev_velocity[p][k]
        out[i, 12] = state.particle_inv_mass[p]
        out[i, 15] = state.particle_mass[p]
        out[i, 16] = state.particle_aim[p]
        for k in range(3):
            out[i, 17 + k] = state.particle_target[p][k]
            out[i, 20 + k] = state.particle_push[p][k]
            out[i, 23 + k] = state.particle_reaction[p][k]
        out[i, 13] = 0.0
        if ti.static(state.capacity.implicit):
            out[i, 13] = state.particle_contact[p]
        out[i, 14] = state.particle_touches[p]


@ti.kernel
def write_body(
    state: ti.template(),
    body: ti.i32,
    status: ti.i32,
    model_of: ti.i32,
    motion: ti.types.ndarray(dtype=ti.f32, ndim=2),
    rest: ti.types.ndarray(dtype=ti.f32, ndim=2),
    particles: ti.types.ndarray(dtype=ti.i32, ndim=1),
    tet_vertices: ti.types.ndarray(dtype=ti.i32, ndim=1),
    tet_edges: ti.types.ndarray(dtype=ti.i32, ndim=1),
    rest_inverses: ti.types.ndarray(dtype=ti.f32, ndim=2),
    edges: ti.types.ndarray(dtype=ti.i32, ndim=2),
    edge_damping: ti.types.ndarray(dtype=ti.f32, ndim=1),
    edge_blocks: ti.types.ndarray(dtype=ti.i32, ndim=2),
    triangles: ti.types.ndarray(dtype=ti.i32, ndim=2),
    outer: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Write a body into its slot. Indices count from the slot's first rows.

    Args:
        model_of: body from which the fields in `state.inherited` are copied: the body itself, or the body
            from which it was cut.
        motion: one row for each vertex in the caller's order, see `read_motion`.
        rest: positions of the particles at rest [m], in kernel order.
        particles: particle of each vertex.
        tet_vertices, tet_edges: vertices and edges of the tetrahedra, in blocks.
        rest_inverses: current and original inverse rest shapes, in blocks.
        edges, edge_damping: edges and their damping, with the spare rows.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        p0, b0 = state.body_particles[body][0], state.body_blocks[body][0]
        e0, c0 = state.body_edges[body][0], state.body_edge_blocks[body][0]
        t0, o0 = state.body_triangles[body][0], state.body_outer[body][0]
        origin = state.body_origin[model_of]
        for i in range(particles.shape[0]):
            p = p0 + particles[i]
            state.particle_of_vertex[p0 + i] = p
            state.particle_position[p] = _three(motion, i, 0)
            if (origin != 0.0).any():
                place_local(state, p, _three(motion, i, 0), origin)
            state.particle_velocity[p] = _three(motion, i, 3)
            state.prev_position[p] = _three(motion, i, 6) + origin
            state.prev_velocity[p] = _three(motion, i, 9)
            state.particle_inv_mass[p] = motion[i, 12]
            state.particle_force[p] = ti.Vector.zero(state.real, 4)
            state.particle_mass[p] = motion[i, 15]
            state.particle_aim[p] = int(motion[i, 16])
            state.particle_target[p] = _three(motion, i, 17)
            state.particle_push[p] = _three(motion, i, 20)
            state.particle_reaction[p] = _three(motion, i, 23)
            if ti.static(state.capacity.implicit):
                state.particle_contact[p] = int(motion[i, 13])
            state.particle_touches[p] = int(motion[i, 14])
            if ti.static(state.capacity.has_contact):
                state.colliders.particle_clearance[p] = NO_CONTACT
            state.rest_position[p0 + i] = _three(rest, i, 0)
        for i in range(tet_vertices.shape[0]):
            state.tet_vertices[b0 * 4 * LANES + i] = p0 + tet_vertices[i]
        for i in range(rest_inverses.shape[1]):
            state.tet_rest_inverse[b0 * 9 * LANES + i] = rest_inverses[0, i]
            if ti.static(state.capacity.plastic):
                state.tet_original_inverse[b0 * 9 * LANES + i] = rest_inverses[1, i]
        if ti.static(state.capacity.implicit):
            for i in range(tet_edges.shape[0]):
                state.tet_edges[b0 * 6 * LANES + i] = e0 + tet_edges[i]
        for i in range(edges.shape[0]):
            state.edge_vertices[e0 + i] = ti.Vector([p0 + edges[i, 0], p0 + edges[i, 1]])
            state.edge_damping[e0 + i] = edge_damping[i]
        for i in range(edge_blocks.shape[0]):
            state.edge_blocks[c0 + i] = ti.Vector([e0 + edge_blocks[i, 0], edge_blocks[i, 1]])
        for i in range(triangles.shape[0]):
            corners = ti.Vector([triangles[i, 0], triangles[i, 1], triangles[i, 2]])
            state.triangle_vertices[t0 + i] = p0 + corners
        for i in range(outer.shape[0]):
            state.outer_particle[o0 + i] = p0 + outer[i]
        state.body_particles[body] = ti.Vector([p0, p0 + particles.shape[0]])
        state.body_blocks[body] = ti.Vector([b0, b0 + tet_vertices.shape[0] // (4 * LANES)])
        state.body_edges[body] = ti.Vector([e0, e0 + edges.shape[0] - LANES])
        state.body_edge_blocks[body] = ti.Vector([c0, c0 + edge_blocks.shape[0]])
        state.body_triangles[body] = ti.Vector([t0, t0 + triangles.shape[0]])
        state.body_outer[body] = ti.Vector([o0, o0 + outer.shape[0]])
        for field in ti.static(state.inherited):
            field[body] = field[model_of]
        state.body_calm_time[body] = 0.0
        state.body_status[body] = status


@ti.kernel
def write_touching(
    state: ti.template(),
    body: ti.i32,
    outer: ti.types.ndarray(dtype=ti.i32, ndim=1),
    triangles: ti.types.ndarray(dtype=ti.i32, ndim=2),
    carriers: ti.types.ndarray(dtype=ti.i32, ndim=2),
    weights: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Write the contact surface of a body in a world with hulls.

    The arguments after `body` are the results of `contact.hull_fields.touching_rows`.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        p0 = state.body_particles[body][0]
        o0, t0 = state.hull.body_outer[body][0], state.hull.body_triangles[body][0]
        first = state.hull.body_points[body][0]
        for i in range(outer.shape[0]):
            state.hull.outer_particle[o0 + i] = p0 + outer[i]
        for i in range(triangles.shape[0]):
            for k in ti.static(range(3)):
                state.hull.triangle_vertices[t0 + i][k] = p0 + triangles[i, k]
        for i in range(carriers.shape[0]):
            for k in ti.static(range(4)):
                state.hull.carriers[first + i][k] = p0 + carriers[i, k]
                state.hull.weights[first + i][k] = weights[i, k]
        state.hull.body_outer[body] = ti.Vector([o0, o0 + outer.shape[0]])
        state.hull.body_triangles[body] = ti.Vector([t0, t0 + triangles.shape[0]])


@ti.kernel
def write_contact_edges(
    state: ti.template(), body: ti.i32, sharp: ti.i32, edges: ti.types.ndarray(dtype=ti.i32, ndim=2)
):
    """Write the contact edges of a body, (m, 4), and their number of sharp edges: see `touching_edges`."""
    ti.loop_config(serialize=True)
    for _ in range(1):
        p0, e0 = state.body_particles[body][0], state.soft.body_edges[body][0]
        for i in range(edges.shape[0]):
            for k in ti.static(range(4)):
                state.soft.edge_corners[e0 + i][k] = ti.select(
                    edges[i, k] >= 0, p0 + edges[i, k], edges[i, k]
                )
        state.soft.body_edges[body] = ti.Vector([e0, e0 + edges.shape[0]])
        state.soft.body_sharp_end[body] = e0 + sharp
        clear_kept_impulses(state, body)


@ti.kernel
def write_kind(state: ti.template(), body: ti.i32, row: ti.types.ndarray(dtype=ti.f32, ndim=1)):
    """Write the row of a body: friction, thickness [m] and the numbers of `SoftBodyAsset.kind_row`."""
    state.body_edge[body] = row[2]
    state.body_stride[body] = row[3]
    state.body_sound_speed[body] = row[4]
    state.body_fading[body] = row[5]
    state.body_fading_interval[body] = row[6]
    state.body_surface[body] = ti.Vector([row[0], row[1], row[2]])
