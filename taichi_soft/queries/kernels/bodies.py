"""Kernels for queries between steps: rays, closest points, overlaps. Queries do not change the motion.

Bodies are tested in ascending order, and only a strictly nearer result replaces the best result. In a tie,
the first face of the first body is therefore returned, for any number of threads.
"""

from taichi_soft.bodies.kernels.faces import box_around, face_corners, face_count, is_inside, write_result
from taichi_soft.bodies.status import ABSENT
from taichi_soft.core.math.rows import row_behind
from taichi_soft.core.math.triangle import closest_point_on_triangle, pierce_triangle, triangle_touches_box
from taichi_soft.core.runtime import ti


@ti.func
def axes_across(d):
    """Return two axes that form a right-handed frame with the unit vector `d` (Duff et al. 2017)."""
    sign = ti.select(d.z < 0.0, -1.0, 1.0)
    s = -1.0 / (sign + d.z)
    right = ti.Vector([1.0 + sign * d.x * d.x * s, sign * d.x * d.y * s, -sign * d.x])
    return right, ti.Vector([d.x * d.y * s, sign + d.y * d.y * s, -d.y])


@ti.func
def entry_of(lower, upper, inv_direction):
    """Return the distance along a ray from its origin to a box [m].

    If the ray misses the box, the result is larger than the limit of any ray.
    Args: lower, upper: corners of the box relative to the ray's origin [m].
    """
    slack = 2e-6 * ti.max(ti.abs(lower).max(), ti.abs(upper).max())
    one, other = (lower - slack) * inv_direction, (upper + slack) * inv_direction
    near, far = ti.min(one, other).max(), ti.max(one, other).min()
    return ti.select(near <= far and far >= 0.0, near, 3.4e38)


@ti.kernel
def find_hits(
    state: ti.template(),
    is_serial: ti.template(),
    bodies: ti.types.ndarray(dtype=ti.i32, ndim=1),
    rays: ti.types.ndarray(dtype=ti.f32, ndim=2),
    hits: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Find the nearest hit of each ray.

    Args:
        bodies: bodies to test, ascending.
        rays: (n, 8): origin [m], unit direction, largest distance [m], 1 to ignore back faces.
        hits: (n, 12), see `write_result`. The row of a ray that hits nothing stays unchanged.
    """
    ti.loop_config(serialize=True)
    for i in range(bodies.shape[0]):
        lower, upper = box_around(state, bodies[i])
        state.body_lower[bodies[i]], state.body_upper[bodies[i]] = lower, upper
    ti.loop_config(serialize=is_serial)
    for r in range(rays.shape[0]):
        origin = ti.Vector([rays[r, 0], rays[r, 1], rays[r, 2]])
        d = ti.Vector([rays[r, 3], rays[r, 4], rays[r, 5]])
        right, up = axes_across(d)
        inv = 1.0 / ti.select(ti.abs(d) < 1e-12, 1e-12, d)
        best, best_body, best_face = rays[r, 6], -1, -1
        weights = ti.Vector.zero(state.real, 3)
        for i in range(bodies.shape[0]):
            body = bodies[i]
            if entry_of(state.body_lower[body] - origin, state.body_upper[body] - origin, inv) < best:
                face, faces = 0, face_count(state, body)
                while face < faces:
                    a, b, c = face_corners(state, body, face, origin)
                    side, w = pierce_triangle(
                        ti.Vector([right.dot(a), up.dot(a), d.dot(a)]),
                        ti.Vector([right.dot(b), up.dot(b), d.dot(b)]),
                        ti.Vector([right.dot(c), up.dot(c), d.dot(c)]),
                    )
                    distance = d.dot(a * w[0] + b * w[1] + c * w[2])
                    is_seen = side < 0 or (side > 0 and rays[r, 7] == 0.0)
                    if is_seen and distance >= 0.0 and distance < best:
                        best, best_body, best_face, weights = distance, body, face, w
                    face = row_behind(face)
        if best_body >= 0:
            write_result(state, r, hits, best_body, best_face, weights, best, d)


@ti.kernel
def find_closest(
    state: ti.template(),
    bodies: ti.types.ndarray(dtype=ti.i32, ndim=1),
    query: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Find the point on the surfaces that is closest to a given point.

    Args:
        bodies: bodies to test, ascending.
        query: (4,): given point [m] and square of the largest distance [m^2].
        found: (1, 13): columns of `write_result`, then 1 if the given point is inside the body, else 0. The
            row stays unchanged if no surface is in range.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        x = ti.Vector([query[0], query[1], query[2]])
        best, best_body, best_face = query[3], -1, -1
        weights, away = ti.Vector.zero(state.real, 3), ti.Vector.zero(state.real, 3)
        is_in_box = False
        for i in range(bodies.shape[0]):
            body = bodies[i]
            lower, upper = box_around(state, body)
            beyond = ti.max(lower - x, x - upper, 0.0)
            if beyond.dot(beyond) <= best:
                for face in range(face_count(state, body)):
                    a, b, c = face_corners(state, body, face, x)
                    w = closest_point_on_triangle(x * 0.0, a, b, c)
                    gap = a * w[0] + b * w[1] + c * w[2]
                    if gap.dot(gap) < best:
                        best, best_body, best_face, weights, away = gap.dot(gap), body, face, w, -gap
                        is_in_box = beyond.max() == 0.0
        if best_body >= 0:
            write_result(state, 0, found, best_body, best_face, weights, ti.sqrt(best), away)
            found[0, 12] = 0.0
            if is_in_box and is_inside(state, best_body, x):
                found[0, 12] = 1.0


@ti.func
def shape_contains(size, is_box, x):
    """True if the point `x` lies in a shape or on its surface. `x` is in the frame of the shape [m]."""
    beyond = (ti.abs(x) - 0.5 * size).max()
    if is_box == 0:
        beyond = x.dot(x) - size.x * size.x
    return beyond <= 0.0


@ti.func
def shape_touches(size, is_box, a, b, c):
    """True if a triangle touches a shape. The corners of the triangle are in the frame of the shape."""
    touches = False
    if is_box != 0:
        touches = triangle_touches_box(a, b, c, 0.5 * size)
    else:
        w = closest_point_on_triangle(a * 0.0, a, b, c)
        gap = a * w[0] + b * w[1] + c * w[2]
        touches = gap.dot(gap) <= size.x * size.x
    return touches


@ti.kernel
def find_overlaps(
    state: ti.template(),
    is_box: ti.i32,
    bodies: ti.types.ndarray(dtype=ti.i32, ndim=1),
    shape: ti.types.ndarray(dtype=ti.f32, ndim=2),
    first_vertex: ti.types.ndarray(dtype=ti.i32, ndim=1),
    inside: ti.types.ndarray(dtype=ti.i32, ndim=1),
):
    """Find the bodies that touch or enclose a sphere or a box.

    Args:
        bodies: indices of the bodies to test.
        shape: (5, 3): row 0 is the centre [m], rows 1 to 3 are the axes of the box, and row 4 is the size of
            the box [m]. For a sphere, each column of row 4 is the radius [m].
        first_vertex: receives the first row in `inside` of each body that overlaps the shape.
        inside: receives 1 for each vertex in the shape. Vertices are in the caller's order.
    """
    ti.loop_config(serialize=True)
    for row in range(bodies.shape[0]):
        body = bodies[row]
        center = ti.Vector([shape[0, k] for k in range(3)])
        axes = ti.Matrix([[shape[1 + j, k] for k in range(3)] for j in range(3)])
        size = ti.Vector([shape[4, k] for k in range(3)])
        half_extent = ti.abs(axes.transpose()) @ (ti.select(is_box != 0, 0.5, 1.0) * size)
        lower, upper = box_around(state, body)
        boxes_overlap = ti.min(upper - center + half_extent, half_extent - lower + center).min() >= 0.0
        touches = 0
        if boxes_overlap and state.body_status[body] < ABSENT:
            particles = state.body_particles[body]
            for i in range(particles[0], particles[1]):
                x = axes @ (state.particle_position[state.particle_of_vertex[i]] - center)
                if shape_contains(size, is_box, x):
                    inside[i] = 1
                    touches = 1
            face, faces = 0, face_count(state, body)
            while face < faces:
                if touches == 0:
                    a, b, c = face_corners(state, body, face, center)
                    touches = int(shape_touches(size, is_box, axes @ a, axes @ b, axes @ c))
                face = row_behind(face)
            if touches == 0 and ti.min(upper - center, center - lower).min() >= 0.0:
                touches = int(is_inside(state, body, center))
            if touches == 1:
                first_vertex[body] = particles[0]
