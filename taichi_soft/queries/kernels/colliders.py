"""Kernels for queries on colliders between steps. Queries do not change the motion.

Colliders are tested in ascending order, and only a strictly nearer result replaces the best result. The
poses are arguments, because the fields contain those at the start of the last step.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.fields import NO_COLLIDER
from taichi_soft.core.math.quaternion import turned, turned_back
from taichi_soft.core.math.rows import row_at
from taichi_soft.core.runtime import ti
from taichi_soft.queries.kernels.convex import (
    LEAST_APPROACH,
    NO_HIT,
    POINT,
    can_touch,
    core_extent,
    core_radius,
    touch_triangle,
)
from taichi_soft.queries.kernels.grid_cells import closest_on_grid, touch_grid

CAST_WIDTH = 16
"""Columns of a cast: origin (3) [m], unit direction (3), largest distance [m], core, half of its lengths (3)
[m], radius [m], rotation (4)."""


@ti.func
def _quaternion(rows: ti.template(), i, column):
    return ti.Vector([rows[i, column], rows[i, column + 1], rows[i, column + 2], rows[i, column + 3]])


@ti.func
def relative_turn(q, r):
    """Return the rotation `r` in the frame of the rotation `q`, unit quaternions."""
    v = r.xyz * q.w - q.xyz * r.w - q.xyz.cross(r.xyz)
    return ti.Vector([v.x, v.y, v.z, q.w * r.w + q.xyz.dot(r.xyz)])


@ti.func
def _touch_rounded(core, half, radius, extra, d, a, b, best):
    """Return `best`, or a nearer touch with a segment from `a` to `b` with the radius `extra`."""
    nearest = best
    found = touch_triangle(core, half, radius + extra, d, a, a, b, best[0])
    is_inside_ray = found[0] < 0.0 and core == POINT and radius == 0.0
    if found[0] < best[0] and not is_inside_ray:
        nearest = found
        for k in ti.static(range(3)):
            nearest[4 + k] = found[4 + k] + extra * found[1 + k]
    return nearest


@ti.func
def _touch_plane(core, half, radius, d, n, height, best):
    """Return `best`, or a nearer touch with a plane of the normal n at `height` below the origin [m]."""
    nearest = best
    gap, approach = height - radius - core_extent(core, half, n), -d.dot(n)
    is_inside_ray = gap < 0.0 and core == POINT and radius == 0.0
    if approach >= LEAST_APPROACH and not is_inside_ray:
        distance = ti.select(gap < 0.0, gap, gap / approach)
        if distance < best[0]:
            side = ti.Vector([0.0, 0.0, 0.0])
            for k in ti.static(range(3)):
                side[k] = ti.select(n[k] > 0.0, -1.0, ti.select(n[k] < 0.0, 1.0, 0.0))
            place = ti.max(distance, 0.0) * d + ti.select(core == POINT, 0.0, half * side)
            place -= (n.dot(place) + height) * n
            nearest[0] = distance
            for k in ti.static(range(3)):
                nearest[1 + k], nearest[4 + k] = n[k], place[k]
    return nearest


@ti.func
def _touch_box(core, half, radius, d, origin, turn, size, best, reach):
    """Return `best`, or a nearer touch with a box, from its twelve triangles."""
    nearest = best
    for f in range(12):
        axis, side, part = f // 4, 2 * (f // 2 % 2) - 1, f % 2
        corners = ti.Matrix.zero(ti.f32, 3, 3)
        for k in ti.static(range(3)):
            # Around the face: (-1, -1), (1, -1), (1, 1), (-1, 1); reversed on the lower side.
            at = ti.select(k == 0, 0, k + part)
            at = ti.select(side > 0, at, (4 - at) % 4)
            u, v = ti.select(at == 1 or at == 2, 1.0, -1.0), ti.select(at >= 2, 1.0, -1.0)
            for m in ti.static(range(3)):
                if axis == m:
                    corners[k, m] = side * size[m]
                    corners[k, (m + 1) % 3] = u * size[(m + 1) % 3]
                    corners[k, (m + 2) % 3] = v * size[(m + 2) % 3]
        a = turned_back(turn, ti.Vector([corners[0, 0], corners[0, 1], corners[0, 2]]) - origin)
        b = turned_back(turn, ti.Vector([corners[1, 0], corners[1, 1], corners[1, 2]]) - origin)
        c = turned_back(turn, ti.Vector([corners[2, 0], corners[2, 1], corners[2, 2]]) - origin)
        if can_touch(reach, d, a, b, c, nearest[0]):
            found = touch_triangle(core, half, radius, d, a, b, c, nearest[0])
            if found[0] < nearest[0]:
                nearest = found
    return nearest


@ti.func
def _touch_inside(core, half, radius, d, distance, normal, best):
    """Return `best`, or a deeper overlap of a shape with a solid in which its centre lies.

    Args:
        distance, normal: signed distance of the centre, negative [m]; normal in the frame of the shape.
    """
    nearest = best
    depth = distance - radius - core_extent(core, half, normal)
    if depth < best[0] and d.dot(normal) <= -LEAST_APPROACH:
        nearest[0] = depth
        for k in ti.static(range(3)):
            nearest[1 + k], nearest[4 + k] = normal[k], -distance * normal[k]
    return nearest


@ti.kernel
def cast_on_colliders(
    state: ti.template(),
    is_serial: ti.template(),
    chosen: ti.types.ndarray(dtype=ti.i32, ndim=1),
    poses: ti.types.ndarray(dtype=ti.f32, ndim=2),
    casts: ti.types.ndarray(dtype=ti.f32, ndim=2),
    hits: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Find the first touch of each moving shape with a collider, if it is nearer than that in `hits`.

    Args:
        chosen: colliders to test, ascending.
        poses: position [m] and quaternion of each of these colliders.
        casts: see `CAST_WIDTH`.
        hits: (n, 13): distance [m], weights (3), place (3) [m], normal (3), body, triangle, collider. The
            distance is negative for shapes that overlap at the start: the depth. A row without a nearer hit
            stays unchanged.
    """
    ti.loop_config(serialize=is_serial)
    for r in range(casts.shape[0]):
        start, ahead, frame = row_at(casts, r, 0), row_at(casts, r, 3), _quaternion(casts, r, 12)
        core, half, radius = int(casts[r, 7]), row_at(casts, r, 8), casts[r, 11]
        d, reach = turned_back(frame, ahead), radius + core_radius(core, half)
        limit = casts[r, 6]
        if hits[r, 10] >= 0.0:
            limit = hits[r, 0]
        best = ti.Vector([limit, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        which = -1
        for i in range(chosen.shape[0]):
            c, q = chosen[i], _quaternion(poses, i, 3)
            kind, parameters = state.colliders.kind[c], state.colliders.parameters[c]
            resolution, offset = state.colliders.resolution[c], state.colliders.offset[c]
            # Centre and rotation of the shape in the frame of the collider.
            origin, turn = turned_back(q, start - row_at(poses, i, 0)), relative_turn(q, frame)
            before = best[0]
            is_ray = core == POINT and radius == 0.0
            if kind == ShapeKind.PLANE:
                n = turned_back(turn, ti.Vector([parameters[0], parameters[1], parameters[2]]))
                height = origin.x * parameters[0] + origin.y * parameters[1] + origin.z * parameters[2]
                best = _touch_plane(core, half, radius, d, n, height, best)
            elif kind == ShapeKind.SPHERE or kind == ShapeKind.CAPSULE:
                axis = ti.Vector([0.0, 0.0, 0.0])
                if kind == ShapeKind.CAPSULE:
                    axis[2] = parameters[1]
                a, b = turned_back(turn, -axis - origin), turned_back(turn, axis - origin)
                best = _touch_rounded(core, half, radius, parameters[0], d, a, b, best)
            elif kind != NO_COLLIDER:
                distance, normal = signed_distance(
                    state.colliders.samples, kind, parameters, resolution, offset, origin
                )
                if distance < 0.0 and not is_ray:
                    best = _touch_inside(core, half, radius, d, distance, turned_back(turn, normal), best)
                if kind == ShapeKind.BOX:
                    size = ti.Vector([parameters[0], parameters[1], parameters[2]])
                    best = _touch_box(core, half, radius, d, origin, turn, size, best, reach)
                else:
                    best = touch_grid(
                        state.colliders.samples,
                        kind,
                        parameters,
                        resolution,
                        offset,
                        core,
                        half,
                        radius,
                        d,
                        origin,
                        turn,
                        best,
                        reach,
                    )
            if best[0] < before:
                which = c
        if which >= 0:
            normal = turned(frame, ti.Vector([best[1], best[2], best[3]]))
            place = start + turned(frame, ti.Vector([best[4], best[5], best[6]]))
            if core == POINT and radius == 0.0:
                place = start + best[0] * ahead
            for k in ti.static(range(3)):
                hits[r, 1 + k], hits[r, 4 + k], hits[r, 7 + k] = 0.0, place[k], normal[k]
            hits[r, 0] = best[0]
            hits[r, 10], hits[r, 11], hits[r, 12] = -1.0, -1.0, which


@ti.kernel
def closest_on_colliders(
    state: ti.template(),
    chosen: ti.types.ndarray(dtype=ti.i32, ndim=1),
    poses: ti.types.ndarray(dtype=ti.f32, ndim=2),
    query: ti.types.ndarray(dtype=ti.f32, ndim=1),
    found: ti.types.ndarray(dtype=ti.f32, ndim=2),
):
    """Find the point of the colliders closest to a given point, if it is nearer than that in `found`.

    Args:
        chosen, poses: see `cast_on_colliders`.
        query: (4,): given point [m] and square of the largest distance [m^2].
        found: (1, 14): columns of `hits` up to the triangle, then 1 if the given point is inside, and the
            collider. The row stays unchanged if nothing is nearer.
    """
    ti.loop_config(serialize=True)
    for _ in range(1):
        given = ti.Vector([query[0], query[1], query[2]])
        limit = ti.sqrt(query[3])
        if found[0, 10] >= 0.0:
            limit = found[0, 0]
        for i in range(chosen.shape[0]):
            c, q, position = chosen[i], _quaternion(poses, i, 3), row_at(poses, i, 0)
            kind, parameters = state.colliders.kind[c], state.colliders.parameters[c]
            resolution, offset = state.colliders.resolution[c], state.colliders.offset[c]
            x = turned_back(q, given - position)
            signed, normal = signed_distance(state.colliders.samples, kind, parameters, resolution, offset, x)
            distance, place = ti.abs(signed), -signed * normal
            if kind == ShapeKind.HEIGHT_FIELD or kind == ShapeKind.MESH:
                best = ti.Vector([ti.cast(NO_HIT, ti.f32), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
                best[0] = limit
                best = closest_on_grid(state.colliders.samples, kind, parameters, resolution, offset, x, best)
                distance = best[0]
                normal, place = ti.Vector([best[1], best[2], best[3]]), ti.Vector([best[4], best[5], best[6]])
            if distance < limit:
                limit = distance
                outward, at = turned(q, normal), given + turned(q, place)
                for k in ti.static(range(3)):
                    found[0, 1 + k], found[0, 4 + k], found[0, 7 + k] = 0.0, at[k], outward[k]
                found[0, 0], found[0, 10], found[0, 11] = distance, -1.0, -1.0
                found[0, 12] = ti.select(signed < 0.0, 1.0, 0.0)
                found[0, 13] = c
