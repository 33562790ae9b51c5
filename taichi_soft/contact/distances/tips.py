"""Tips of convex colliders: points that can touch the inside of a triangle, but none of its edges.

Tips are the corners of a box, the centres of the ends of a capsule, and the centre of a sphere. A tip touches
when its distance from the triangle is the radius of the collider there, plus the thickness of its skin.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.lowest_point import Vector8
from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.distances.sweep import NO_TOUCH, TOUCHING
from taichi_soft.contact.distances.triangle_sweep import EDGE, HOLDING, SLACK, corner_of
from taichi_soft.core.math.triangle import closest_point_on_triangle
from taichi_soft.core.runtime import ti

DEEPEST = 5e-3
"""Depth of a tip below a triangle from which on it is ignored: it has come through another triangle [m]."""


@ti.func
def tip_count(kind):
    """Return the number of tips of a kind of solid, 0 if the solid is not convex."""
    count = ti.select(kind == ShapeKind.BOX, 8, 0)
    return ti.select(kind == ShapeKind.CAPSULE, 2, ti.select(kind == ShapeKind.SPHERE, 1, count))


@ti.func
def _tip(colliders: ti.template(), c, number):
    """Return a tip in the frame of its collider, and the distance at which it touches [m]."""
    parameters = colliders.parameters[c]
    tip, radius = ti.Vector.zero(ti.f32, 3), parameters[0]
    if colliders.kind[c] == ShapeKind.BOX:
        for i in ti.static(range(3)):
            tip[i] = ti.select((number >> i) & 1 == 1, parameters[i], -parameters[i])
        radius = 0.0
    elif colliders.kind[c] == ShapeKind.CAPSULE:
        tip[2] = ti.select(number == 1, parameters[1], -parameters[1])
    return tip, radius + colliders.surface[c].z


@ti.func
def tip_distance(colliders: ti.template(), c, x):
    """Return the distance of a point from the nearest tip of a collider [m], negative if it is not convex."""
    nearest = ti.cast(-1e30, ti.f32)
    for number in range(tip_count(colliders.kind[c])):
        tip, radius = _tip(colliders, c, number)
        distance = (x - tip).norm() - radius
        nearest = ti.select(number == 0, distance, ti.min(nearest, distance))
    return nearest


@ti.func
def _unit_normal(corners: ti.template()):
    n = (corner_of(corners, 1) - corner_of(corners, 0)).cross(corner_of(corners, 2) - corner_of(corners, 0))
    return n / ti.max(n.norm(), 1e-30)


@ti.real_func
def touch_of_tip(
    colliders: ti.template(),
    c: ti.i32,
    number: ti.i32,
    start: ti.math.mat3,
    end: ti.math.mat3,
    is_solid: ti.i32,
    is_short: ti.i32,
) -> Vector8:
    """Find the first touch of a tip with the inside of a moving triangle.

    Args:
        is_solid: 1 if the triangle is oriented outwards, and is touched from there.
        is_short: 1 if only the end of the path is checked.
    Returns: see `first_touch_of_triangle`.
    """
    tip, radius = _tip(colliders, c, number)
    before = _unit_normal(start).dot(tip - corner_of(start, 0))
    after = _unit_normal(end).dot(tip - corner_of(end, 0))
    side = ti.select(is_solid == 1 or before >= 0.0, 1.0, -1.0)
    height0, height1 = side * before - radius, side * after - radius
    touch = Vector8(NO_TOUCH)
    if height1 <= HOLDING and (height1 < height0 or height1 < -SLACK) and height0 > -DEEPEST - radius:
        since = ti.select(height0 > HOLDING, height0 / ti.max(height0 - height1, 1e-30), 0.0)
        part = ti.select(is_short == 1, 1.0, since)
        since = ti.select(is_short == 1, 0.0, since)
        here = start + part * (end - start)
        weights = closest_point_on_triangle(tip, corner_of(here, 0), corner_of(here, 1), corner_of(here, 2))
        if weights.min() > EDGE:
            n = -side * _unit_normal(here)
            distance = ti.select(is_short == 1, height1, ti.min(height0, TOUCHING))
            touch = Vector8(since, part, distance, weights.x, weights.y, n.x, n.y, n.z)
    return touch
