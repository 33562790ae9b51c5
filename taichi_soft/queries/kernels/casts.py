"""Kernel for casts of shapes on the surfaces of bodies, between steps. Queries do not change the motion."""

from taichi_soft.bodies.kernels.faces import (
    box_around,
    face_corners,
    face_count,
    is_inside,
)
from taichi_soft.core.math.quaternion import turned, turned_back
from taichi_soft.core.math.rows import row_at
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti
from taichi_soft.queries.kernels.bodies import entry_of
from taichi_soft.queries.kernels.convex import (
    LEAST_APPROACH,
    can_touch,
    core_extent,
    core_radius,
    touch_triangle,
)


@ti.kernel
def cast_on_bodies(
    state: ti.template(),
    bodies: ti.types.ndarray(dtype=ti.i32, ndim=1),
    casts: ti.types.ndarray(dtype=ti.f32, ndim=2),
    hits: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Find the first touch of a moving shape with a body.

    A shape whose centre is inside a body overlaps it. Vertices of bodies without triangles count as points.
    Args:
        bodies: bodies to test, ascending.
        casts: (1, 16), see `colliders.CAST_WIDTH`.
        hits: (1, 13), see `colliders.cast_on_colliders`.
    """
    ti.loop_config(serialize=True)
    for r in range(1):
        start, ahead = row_at(casts, r, 0), row_at(casts, r, 3)
        frame = ti.Vector([casts[r, 12], casts[r, 13], casts[r, 14], casts[r, 15]])
        core, half, radius = int(casts[r, 7]), row_at(casts, r, 8), casts[r, 11]
        d, reach = turned_back(frame, ahead), radius + core_radius(core, half)
        inv = 1.0 / ti.select(ti.abs(ahead) < 1e-12, 1e-12, ahead)
        best = ti.Vector([casts[r, 6], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        which, triangle = -1, -1
        for i in range(bodies.shape[0]):
            body = bodies[i]
            lower, upper = box_around(state, body)
            lower, upper = ti.cast(lower - start, ti.f32), ti.cast(upper - start, ti.f32)
            if entry_of(lower - reach, upper + reach, inv) < ti.max(best[0], 1e-30):
                contains = False
                if ti.min(upper, -lower).min() >= 0.0:
                    contains = is_inside(state, body, start)
                nearest_face, nearest, outward = -1, ti.cast(3.4e38, ti.f32), ti.Vector([0.0, 0.0, 0.0])
                for face in range(face_count(state, body)):
                    x, y, z = face_corners(state, body, face, start)
                    a = turned_back(frame, ti.cast(x, ti.f32))
                    b = turned_back(frame, ti.cast(y, ti.f32))
                    c = turned_back(frame, ti.cast(z, ti.f32))
                    if contains:
                        w = closest_point_on_triangle(a * 0.0, a, b, c)
                        gap = a * w[0] + b * w[1] + c * w[2]
                        if gap.norm() < nearest:
                            nearest_face, nearest, outward = face, gap.norm(), gap
                    elif can_touch(reach, d, a, b, c, best[0]):
                        found = touch_triangle(core, half, radius, d, a, b, c, best[0])
                        if found[0] < best[0]:
                            best, which, triangle = found, body, face
                if contains and nearest > 0.0:
                    normal = outward / nearest
                    depth = -nearest - radius - core_extent(core, half, normal)
                    if depth < best[0] and d.dot(normal) <= -LEAST_APPROACH:
                        which, triangle = body, nearest_face
                        best[0] = depth
                        for k in ti.static(range(3)):
                            best[1 + k], best[4 + k] = normal[k], outward[k]
        if which >= 0:
            x, y, z = face_corners(state, which, triangle, start)
            a = turned_back(frame, ti.cast(x, ti.f32))
            b = turned_back(frame, ti.cast(y, ti.f32))
            c = turned_back(frame, ti.cast(z, ti.f32))
            place = ti.Vector([best[4], best[5], best[6]])
            weights = closest_point_on_triangle(place, a, b, c)
            normal = turned(frame, ti.Vector([best[1], best[2], best[3]]))
            place = start + turned(frame, place)
            for k in ti.static(range(3)):
                hits[r, 1 + k], hits[r, 4 + k], hits[r, 7 + k] = weights[k], place[k], normal[k]
            hits[r, 0] = best[0]
            hits[r, 10], hits[r, 11], hits[r, 12] = which, triangle, -1.0
