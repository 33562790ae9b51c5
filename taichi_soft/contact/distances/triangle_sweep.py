"""Find the first point at which a moving triangle touches a collider, by conservative advancement.

A convex solid lies behind the tangent plane at its point nearest to the triangle. The triangle can therefore
advance until a corner reaches that plane, and touches nothing if no corner does.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.lowest_point import Vector8, lowest_on_line, lowest_point, probe
from taichi_soft.contact.distances.shape_kind import CONVEX, ShapeKind
from taichi_soft.contact.distances.sweep import NO_TOUCH, TOUCHING
from taichi_soft.core.runtime import ti

MAX_STEPS = 16
"""Largest number of steps along a path. Each step is at least 1/16 of the path."""

SHORT_PATH = 5e-4
"""Path [m] that is checked at its end only. Colliders are thicker than this."""

EDGE = 1e-3
"""Barycentric coordinate below which a point counts as a point of an edge."""

UNKNOWN = 1e30
"""Larger than every distance and path [m]."""

HOLDING = 10.0 * TOUCHING
"""Distance [m] up to which a contact stops an approach. Contacts share corners and move each other a little,
but must not lose their support at once."""

SLACK = 0.2 * TOUCHING
"""Depth behind the tangent plane that counts as rounding [m]."""


@ti.func
def is_convex(kind):
    """Return 1 if a kind of solid is convex, else 0."""
    found = 0
    for each in ti.static(sorted(CONVEX)):
        found = found | int(kind == each)
    return found


@ti.func
def thickness_of(colliders: ti.template(), c):
    """Return the path of a triangle that is checked at its end only [m]."""
    thickness = ti.cast(SHORT_PATH, ti.f32)
    if colliders.kind[c] == ShapeKind.HEIGHT_FIELD:
        thickness = UNKNOWN  # the ground is solid down to infinity
    elif colliders.kind[c] == ShapeKind.MESH:
        thickness = 0.5 * colliders.parameters[c][3]  # the grid resolves nothing thinner than a cell
    return thickness


@ti.func
def is_behind(plane, corners: ti.template()):
    """Return 1 if a plane separates a triangle from the collider behind the plane, else 0.

    Args: plane: normal, towards the triangle; and the negative of its distance from the origin [m].
    """
    heights = corners @ plane.xyz
    return int(heights.min() + plane.w >= -SLACK)


@ti.func
def corner_of(corners: ti.template(), k):
    return ti.Vector([corners[k, 0], corners[k, 1], corners[k, 2]])


@ti.func
def _test_corners(
    colliders: ti.template(), c, start: ti.template(), end: ti.template(), path, is_short, skin
):
    """Test if a triangle stays in front of the collider's tangent plane at one of its corners.

    The tangent planes at the corners bound a convex solid. Beside another solid, the distance of the middle
    is compared with the triangle's size. Then the plane at the first corner counts, if the middle agrees with
    it.

    Returns: 1 if the triangle touches the collider nowhere on its path, else 0; the plane; and a lower bound
    of the distance at the end of the path, beside a solid that is not convex [m].
    """
    is_clear, plane, clearance = 0, ti.Vector.zero(ti.f32, 4), 0.0
    middle, height, corners = (corner_of(end, 0) + corner_of(end, 1) + corner_of(end, 2)) / 3.0, UNKNOWN, 3
    if is_convex(colliders.kind[c]) == 0:
        size = 0.0
        for k in ti.static(range(3)):
            size = ti.max(size, (corner_of(end, k) - middle).norm())
        height = probe(colliders, c, middle, skin).w
        clearance = height - size
        is_clear = int(clearance > path)
        corners = is_short
    i = 0
    while i < corners and is_clear == 0:
        corner = corner_of(end, i)
        found = probe(colliders, c, corner, skin)
        plane = ti.Vector([found.x, found.y, found.z, found.w - found.xyz.dot(corner)])
        is_clear = is_behind(plane, start) & is_behind(plane, end)
        is_clear = is_clear & int(height >= plane.xyz.dot(middle) + plane.w - SLACK)
        if is_clear == 1:
            clearance = found.w
        i += 1
    return is_clear, plane, clearance


@ti.func
def _is_tip(colliders: ti.template(), c, corners: ti.template(), weights, distance, skin):
    """Return 1 if a point inside a triangle is lower than the triangle's edges, else 0."""
    found, k = int(weights.min() > EDGE), 0
    while k < 3 and found == 1:
        a, b = corner_of(corners, k), corner_of(corners, (k + 1) % 3)
        found = int(lowest_on_line(colliders, c, a, b, skin)[1] > distance + 0.5 * TOUCHING)
        k += 1
    return found


@ti.real_func
def first_touch_of_triangle(
    colliders: ti.template(),
    c: ti.i32,
    start: ti.math.mat3,
    end: ti.math.mat3,
    corner: ti.f32,
    is_line: ti.i32,
    skin: ti.f32,
) -> Vector8:
    """Find the first touch of a triangle or of a line with a collider.

    A triangle touches inside only, because its edges are lines of their own.

    Args:
        start, end: corners of the triangle in the collider's frame (rows) [m]. A line has its second end
            twice.
        corner: barycentric coordinate above which a point of a line counts as its end, which cannot touch.
        is_line: 1 for a line, 0 for a triangle.
        skin: distance from the collider's shape that counts as a touch [m].
    Returns: fraction of the path, 0 to 1, after which contact acts, `NO_TOUCH` without a touch; fraction at
        which the touch was found; distance there [m]; first two barycentric coordinates of the point;
        gradient of the distance (3), of length 1 or less. Without a touch, the numbers from the second on are
        a plane that separates the triangle from a convex solid, see `is_behind`, and a lower bound of the
        distance at the end of the path [m].
    """
    moved, path = end - start, 0.0
    for k in ti.static(range(3)):
        path = ti.max(path, corner_of(moved, k).norm())
    convex, is_short = is_convex(colliders.kind[c]), int(path < thickness_of(colliders, c))
    is_clear, plane, clearance = _test_corners(colliders, c, start, end, path, is_short, skin)
    touch, is_open = Vector8(0.0), 1 - is_clear
    part, since = ti.cast(is_short, ti.f32), 0.0
    weights, gradient = ti.Vector.zero(ti.f32, 3), ti.Vector.zero(ti.f32, 3)
    has_touch, distance = 0, 0.0
    while is_open == 1:
        here = start + part * moved
        found = lowest_point(colliders, c, corner_of(here, 0), corner_of(here, 1), corner_of(here, 2), skin)
        weights = ti.Vector([found[0], found[1], found[2]])
        distance = found[3]
        gradient = ti.Vector([found[4], found[5], found[6]])
        climbs, heights = moved @ gradient, here @ gradient
        climb, height = weights.dot(climbs), weights.dot(heights)
        plane = ti.Vector([gradient.x, gradient.y, gradient.z, distance - height - HOLDING])
        step = 1.0 / MAX_STEPS
        can_touch = int(distance <= HOLDING and (distance < -SLACK or climb < 0.0))
        if is_line == 1:
            can_touch = can_touch & int(weights.max() <= corner)
        elif can_touch == 1:
            can_touch = _is_tip(colliders, c, here, weights, distance, skin)
        if can_touch == 1:
            has_touch, is_open = 1, 0
        elif distance <= HOLDING:  # a corner rests on the collider
            step = ti.max(step, ti.min(1.0, SHORT_PATH / ti.max(path, 1e-30)))
        elif convex == 1:
            longest = 1.0
            for k in ti.static(range(3)):
                if climbs[k] < 0.0:
                    longest = ti.min(longest, ti.max(heights[k] - height + distance, 0.0) / -climbs[k])
            if part + longest >= 1.0:
                is_open = 0
            step = ti.max(step, longest)
        else:
            step = ti.max(step, distance / ti.max(path, 1e-30))
        if is_open == 1 and part == 1.0:
            is_open = 0
        elif is_open == 1:
            if distance > HOLDING:
                since = ti.min(part + step, 1.0)
            part = ti.min(part + step, 1.0)
    if is_clear == 0:
        clearance = ti.select(part == 1.0, distance, 0.0)
    touch = Vector8(NO_TOUCH, plane.x, plane.y, plane.z, plane.w, clearance, 0.0, 0.0)
    if has_touch == 1:
        touch = Vector8(since, part, distance, weights.x, weights.y, gradient.x, gradient.y, gradient.z)
    return touch
