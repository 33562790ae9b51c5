"""Find the point of a triangle that is nearest to a collider, or deepest in it.

Signed distances from convex solids are convex, so tangents bound them from below. The search along a line
keeps a point on each side of the minimum, and continues at the intersection of their tangents (Kelley 1960)
or at the root of the interpolated slope. The first ends at a kink, as at a box's edge, the second in a round
valley. A triangle is searched by chords parallel to one side. Near other solids, the search finds a local
minimum.

Groups of fields: reads colliders.
"""

from taichi_soft.contact.distances.distance import signed_distance
from taichi_soft.contact.distances.sweep import TOUCHING
from taichi_soft.core.runtime import ti

MAX_PROBES = 14
"""Largest number of points of a line, and of chords of a triangle, that a search evaluates."""

ACCURACY = 0.2 * TOUCHING
"""Difference from the minimum at which a search ends [m]."""

Vector8 = ti.types.vector(8, ti.f32)


@ti.real_func
def probe(colliders: ti.template(), c: ti.i32, x: ti.math.vec3, skin: ti.f32) -> ti.math.vec4:
    """Return the normal (x, y, z) at a point of a collider's frame, and its distance from the skin (w) [m].

    Args: skin: distance of the skin from the collider's shape [m].
    """
    kind, parameters = colliders.kind[c], colliders.parameters[c]
    resolution, offset = colliders.resolution[c], colliders.offset[c]
    distance, normal = signed_distance(colliders.samples, kind, parameters, resolution, offset, x)
    return ti.Vector([normal.x, normal.y, normal.z, distance - skin])


@ti.func
def _next_probe(at0, low0, slope0, at1, low1, slope1, number):
    """Return where to continue a search between two points, and a lower bound of the minimum if convex.

    Args: at, low, slope: place, distance [m] and its derivative at the two points. The first derivative is
        negative, the second is 0 or more.
    """
    meeting = (low1 - low0 + slope0 * at0 - slope1 * at1) / (slope0 - slope1)
    meeting = ti.max(at0, ti.min(at1, meeting))
    bound = low0 + slope0 * (meeting - at0)
    root = at0 - slope0 * (at1 - at0) / (slope1 - slope0)
    return ti.select(number % 2 == 0, root, meeting), bound


@ti.real_func
def lowest_on_line(
    colliders: ti.template(), c: ti.i32, p: ti.math.vec3, q: ti.math.vec3, skin: ti.f32
) -> Vector8:
    """Find the lowest point of the line from `p` to `q`.

    Returns: place from 0 to 1; distance [m]; gradient, which is normal to the line if the point is inside it.
    """
    along = q - p
    first, last = ti.Vector.zero(ti.f32, 4), ti.Vector.zero(ti.f32, 4)
    at0, slope0, at1, slope1 = 0.0, 0.0, 1.0, -1.0
    at, number, is_open = 0.0, 0, 1
    while is_open == 1:
        found = probe(colliders, c, p + at * along, skin)
        slope = along.dot(found.xyz)
        if number == 0 or slope < 0.0:
            first, at0, slope0 = found, at, slope
        else:
            last, at1, slope1 = found, at, slope
        number += 1
        at = 1.0
        if slope0 >= 0.0 or (number > 1 and slope1 < 0.0):
            is_open = 0  # an end is lowest
        elif number > 1:
            at, bound = _next_probe(at0, first.w, slope0, at1, last.w, slope1, number)
            if ti.min(first.w, last.w) - bound < ACCURACY or number == MAX_PROBES:
                is_open = 0
    place, distance, gradient = at0, first.w, first.xyz
    if slope0 < 0.0 and slope1 >= 0.0:
        gradient = (slope1 * first.xyz - slope0 * last.xyz) / (slope1 - slope0)
        if last.w < first.w:
            place, distance = at1, last.w
    return Vector8(place, distance, gradient.x, gradient.y, gradient.z, 0.0, 0.0, 0.0)


@ti.real_func
def lowest_point(
    colliders: ti.template(), c: ti.i32, x: ti.math.vec3, y: ti.math.vec3, z: ti.math.vec3, skin: ti.f32
) -> Vector8:
    """Find the point of the triangle `x`, `y`, `z` that is nearest to a collider, or deepest in it.

    Points are in the collider's frame. `y` and `z` can be equal: the triangle is then a line.

    Returns: barycentric coordinates (3); distance from the collider's skin [m]; gradient (3). Inside the
    triangle, the gradient is normal to it; inside a side, it is normal to this side.
    """
    first, last = Vector8(0.0), Vector8(0.0)
    at0, slope0, at1, slope1 = 0.0, 0.0, 1.0, -1.0
    at, number, is_open = 0.0, 0, 1
    while is_open == 1:
        found = lowest_on_line(colliders, c, x + at * (y - x), x + at * (z - x), skin)
        gradient = ti.Vector([found[2], found[3], found[4]])
        slope = gradient.dot((1.0 - found[0]) * (y - x) + found[0] * (z - x))
        if number == 0:
            slope = ti.min(gradient.dot(y - x), gradient.dot(z - x))
        if number == 0 or slope < 0.0:
            first, at0, slope0 = found, at, slope
        else:
            last, at1, slope1 = found, at, slope
        number += 1
        at = 1.0
        if slope0 >= 0.0 or (number > 1 and slope1 < 0.0):
            is_open = 0
        elif number > 1:
            at, bound = _next_probe(at0, first[1], slope0, at1, last[1], slope1, number)
            if ti.min(first[1], last[1]) - bound < ACCURACY or number == MAX_PROBES:
                is_open = 0
    best, place = first, at0
    gradient = ti.Vector([first[2], first[3], first[4]])
    if slope0 < 0.0 and slope1 >= 0.0:
        other = ti.Vector([last[2], last[3], last[4]])
        gradient = (slope1 * gradient - slope0 * other) / (slope1 - slope0)
        if last[1] < first[1]:
            best, place = last, at1
    t = best[0]
    return Vector8(
        1.0 - place, place * (1.0 - t), place * t, best[1], gradient.x, gradient.y, gradient.z, 0.0
    )
