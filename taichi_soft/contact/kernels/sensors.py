"""Find the bodies that touch or enclose sensors. Nothing is changed.

Groups of fields: reads colliders.
"""

from taichi_soft.bodies.kernels.faces import box_around, face_corners, face_count, is_inside
from taichi_soft.bodies.status import ABSENT, ASLEEP
from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.shape_kind import CONVEX, ShapeKind
from taichi_soft.core.math.quaternion import turned_back
from taichi_soft.core.math.triangle import closest_point_on_triangle, triangle_touches_box
from taichi_soft.core.runtime import ti

POSE_WIDTH = 13
"""Number of columns of `poses` in `find_bodies_inside`: position, quaternion, lower and upper corner of the
box."""

MAX_MOVES = 64
"""Largest number of points of a triangle that are tested. Only triangles that almost touch need as many."""

AIM = 1e-3
"""Depth behind the surface of a sensor at which the next point of a triangle is aimed [m]. Without it, points
would approach the surface from outside, and never reach it."""


@ti.real_func
def _distance_at(state: ti.template(), c: ti.i32, x: ti.math.vec3) -> ti.math.vec4:
    """Return the outward normal (x, y, z) and the signed distance (w) [m] of a point in a sensor's frame."""
    colliders = state.colliders
    distance, n = signed_distance(
        colliders.samples,
        colliders.kind[c],
        colliders.parameters[c],
        colliders.resolution[c],
        colliders.offset[c],
        x,
    )
    return ti.Vector([n.x, n.y, n.z, distance])


@ti.func
def _comes_in(state: ti.template(), sensor, a, b, c):
    """Return 1 if a triangle touches a sensor, by projecting a point in turn behind the surface of the sensor
    and onto the triangle.

    If even the deepest corner is in front of the tangent plane of a convex sensor, nothing touches it.
    """
    is_convex = 0
    for each in ti.static(sorted(CONVEX)):
        is_convex = is_convex | int(state.colliders.kind[sensor] == each)
    x = (a + b + c) / 3.0
    touches, moves = 0, 0
    while moves < MAX_MOVES and touches == 0:
        found = _distance_at(state, sensor, x)
        distance, n = found.w, found.xyz
        deepest = ti.min(n.dot(a - x), n.dot(b - x), n.dot(c - x))
        farthest = ti.max((a - x).norm(), (b - x).norm(), (c - x).norm())
        moves += 1
        if distance <= 0.0:
            touches = 1
        elif distance > farthest or (is_convex == 1 and distance + deepest > 0.0):
            moves = MAX_MOVES
        else:
            w = closest_point_on_triangle(x - (1.5 * distance + AIM) * n, a, b, c)
            x = w[0] * a + w[1] * b + w[2] * c
    return touches


@ti.real_func
def _face_touches(
    state: ti.template(), sensor: ti.i32, a: ti.math.vec3, b: ti.math.vec3, c: ti.math.vec3
) -> ti.i32:
    """Return 1 if a triangle touches a sensor. Its corners are in the frame of the sensor [m]."""
    kind, parameters = state.colliders.kind[sensor], state.colliders.parameters[sensor]
    touches = 0
    if kind == ShapeKind.BOX:
        touches = int(triangle_touches_box(a, b, c, ti.Vector([parameters[0], parameters[1], parameters[2]])))
    elif kind == ShapeKind.SPHERE:
        w = closest_point_on_triangle(ti.Vector.zero(ti.f32, 3), a, b, c)
        touches = int((w[0] * a + w[1] * b + w[2] * c).norm() <= parameters[0])
    elif kind == ShapeKind.PLANE:
        lowest = ti.min(_distance_at(state, sensor, a).w, _distance_at(state, sensor, b).w)
        touches = int(ti.min(lowest, _distance_at(state, sensor, c).w) <= 0.0)
    else:
        touches = _comes_in(state, sensor, a, b, c)
    return touches


@ti.real_func
def _body_touches(
    state: ti.template(), sensor: ti.i32, body: ti.i32, position: ti.math.vec3, rotation: ti.math.vec4
) -> ti.i32:
    """Return 1 if a body touches or encloses a sensor at a pose."""
    touches = 0
    k, outer = 0, state.body_outer[body]
    while outer[0] + k < outer[1] and touches == 0:
        p = state.outer_particle[outer[0] + k]
        x = turned_back(rotation, state.particle_position[p] - position)
        touches = int(_distance_at(state, sensor, x).w <= 0.0)
        k += 1
    face, faces = 0, face_count(state, body)
    while face < faces and touches == 0:
        a, b, c = face_corners(state, body, face, position)
        touches = _face_touches(
            state, sensor, turned_back(rotation, a), turned_back(rotation, b), turned_back(rotation, c)
        )
        face += 1
    if touches == 0 and _distance_at(state, sensor, ti.Vector.zero(ti.f32, 3)).w <= 0.0:
        touches = int(is_inside(state, body, position))
    return touches


@ti.kernel
def find_bodies_inside(
    state: ti.template(),
    body_count: ti.i32,
    who: ti.types.ndarray(dtype=ti.i32, ndim=2),
    poses: ti.types.ndarray(dtype=ti.f32, ndim=2),
    inside: ti.types.ndarray(dtype=ti.i32, ndim=2),
):
    """Find the bodies that touch or enclose each of some sensors.

    Args:
        who: number, group and mask of each sensor, (k, 3).
        poses: its pose and box, (k, `POSE_WIDTH`) [m].
        inside: receives 1 for each body inside, else 0, (k, bodies).
    """
    ti.loop_config(serialize=True)
    for body in range(body_count):
        lower, upper = state.body_bounds_lower[body], state.body_bounds_upper[body]
        is_there = int(state.body_status[body] < ABSENT)
        if is_there == 1 and state.body_status[body] != ASLEEP:
            lower, upper = box_around(state, body)
        mine = state.body_filter[body]
        for row in range(who.shape[0]):
            meets = is_there & int((mine[0] & who[row, 2]) != 0) & int((mine[1] & who[row, 1]) != 0)
            for i in ti.static(range(3)):
                meets = meets & int(lower[i] <= poses[row, 10 + i]) & int(upper[i] >= poses[row, 7 + i])
            if meets == 1:
                position = ti.Vector([poses[row, 0], poses[row, 1], poses[row, 2]])
                rotation = ti.Vector([poses[row, 3], poses[row, 4], poses[row, 5], poses[row, 6]])
                meets = _body_touches(state, who[row, 0], body, position, rotation)
            inside[row, body] = meets
