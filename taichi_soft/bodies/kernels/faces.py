"""Faces of a deformed surface: the triangles of a body, or its vertices if it has none.

A vertex counts as a triangle of zero size: rays cannot hit it, but queries for nearest points find it. The
faces of a rigid body are those of its hull.

Groups of fields: reads hull.
"""

from taichi_soft.bodies.kernels.rigid import is_rigid
from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.math.triangle import solid_angle
from taichi_soft.core.runtime import ti

INSIDE = 6.283
"""Solid angle of a body's surface, seen from a point, above which the point counts as inside [sr]. The
solid angle of a closed surface is 4 pi from inside and 0 from outside."""


@ti.func
def triangles_of(state: ti.template(), body):
    """Return the range of rows of a body's triangles. They are rows of the hull's fields if it is rigid."""
    triangles = state.body_triangles[body]
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            triangles = state.hull.body_triangles[body]
    return triangles


@ti.func
def position_of(state: ti.template(), p):
    """Return the position of a particle, or of a point of a rigid body's hull [m]."""
    x = state.particle_position[p]
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, state.particle_body[p]):
            x = ti.Vector.zero(state.real, 3)
            for k in ti.static(range(4)):
                x += state.hull.weights[p][k] * state.particle_position[state.hull.carriers[p][k]]
    return x


@ti.func
def face_count(state: ti.template(), body):
    """Return the number of triangles of a body, or of vertices if the body has no triangles.

    A body that is absent or was switched off has no faces.
    """
    triangles, particles = triangles_of(state, body), state.body_particles[body]
    count = triangles[1] - triangles[0]
    if count == 0:
        count = particles[1] - particles[0]
    if state.body_status[body] >= ABSENT:
        count = 0
    return count


@ti.func
def face_particles(state: ti.template(), body, face):
    """Return the three particles of a face. For a vertex, all three are the same particle."""
    triangles = triangles_of(state, body)
    particles = ti.Vector.one(ti.i32, 3)
    if triangles[1] > triangles[0]:
        particles = state.triangle_vertices[triangles[0] + face]
        if ti.static(state.capacity.contact.rigid):
            if is_rigid(state, body):
                particles = state.hull.triangle_vertices[triangles[0] + face]
    else:
        particles *= state.particle_of_vertex[state.body_particles[body][0] + face]
    return particles


@ti.func
def face_corners(state: ti.template(), body, face, origin):
    """Return the three corners of a face relative to `origin` [m]."""
    v = face_particles(state, body, face)
    return (
        position_of(state, v[0]) - origin,
        position_of(state, v[1]) - origin,
        position_of(state, v[2]) - origin,
    )


@ti.func
def box_around(state: ti.template(), body):
    """Return the bounding box of a body: smallest and largest coordinates [m]."""
    lower = ti.Vector([1e30, 1e30, 1e30])
    upper = -lower
    if ti.static(state.capacity.contact.rigid):
        if is_rigid(state, body):
            for p in range(state.hull.body_points[body][0], state.hull.body_points[body][1]):
                lower, upper = ti.min(lower, position_of(state, p)), ti.max(upper, position_of(state, p))
    outer = state.body_outer[body]
    for i in range(outer[0], outer[1]):
        x = state.particle_position[state.outer_particle[i]]
        lower, upper = ti.select(x < lower, x, lower), ti.select(x > upper, x, upper)  # faster than min, max
    return lower, upper


@ti.func
def is_inside(state: ti.template(), body, x):
    """True if a point is inside a body, according to the solid angle of the surface seen from the point.

    The sign of the angle has no effect, because a body can be mirrored.
    """
    total = x.x * 0.0
    for face in range(face_count(state, body)):
        a, b, c = face_corners(state, body, face, x)
        total += solid_angle(a, b, c)
    return ti.abs(total) > INSIDE


@ti.func
def write_result(state: ti.template(), row, out: ti.template(), body, face, weights, distance, away):
    """Write a result to a row of `out`: distance, weights, point, unit normal, body and face.

    The normal is along `away` if the face has no area. All values are float32, which represents integers up
    to 16 million exactly.
    """
    v = face_particles(state, body, face)
    a = position_of(state, v[0])
    b, c = position_of(state, v[1]) - a, position_of(state, v[2]) - a
    point = a + b * weights[1] + c * weights[2]
    normal = b.cross(c)
    if normal.norm() < 1e-30:
        normal = away
    normal /= ti.max(normal.norm(), 1e-30)
    for k in ti.static(range(3)):
        out[row, 1 + k] = weights[k]
        out[row, 4 + k] = point[k]
        out[row, 7 + k] = normal[k]
    out[row, 0] = distance
    out[row, 10] = body
    out[row, 11] = face
