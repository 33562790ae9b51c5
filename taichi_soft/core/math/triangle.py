"""Geometry of one triangle: closest point, ray intersection, solid angle, overlap with a box."""

from taichi_soft.core.math.elementary import atan2
from taichi_soft.core.runtime import ti

_TINY = 1e-37
"""Lower limit of divisors, to prevent a division by zero. If a divisor is smaller, a length is zero in
float32, so the numerator is also zero."""


@ti.func
def closest_point_on_triangle(x, a, b, c):
    """Return the barycentric coordinates of the point of a triangle that is closest to x, vec3.

    The candidates are the projection of x onto the plane, if it is inside the triangle, and the closest point
    of each edge. Rounding errors cannot move a candidate out of the triangle, so degenerate triangles need no
    special case.
    Args:
        x, a, b, c: vec3 [m].
    Returns: weights of a, b and c, each from 0 to 1, with sum 1.
    """
    ab, ac, ax = b - a, c - a, x - a
    bc, bx = c - b, x - b
    n = ab.cross(ac)
    scale = 1.0 / ti.max(n.dot(n), _TINY)
    v, w = ax.cross(ac).dot(n) * scale, ab.cross(ax).dot(n) * scale
    is_inside = ti.min(v, w, 1.0 - v - w) >= 0.0
    v, w = ti.select(is_inside, v, 0.0), ti.select(is_inside, w, 0.0)  # corner a if the projection is outside
    gap = ax - ab * v - ac * w
    best = gap.dot(gap)
    for edge in ti.static(range(3)):
        away, along = ((ax, ab), (bx, bc), (ax, ac))[edge]
        t = ti.min(ti.max(away.dot(along) / ti.max(along.dot(along), _TINY), 0.0), 1.0)
        gap = away - along * t
        distance = gap.dot(gap)
        is_nearer = distance < best  # branch-free for vectorisation
        best = ti.select(is_nearer, distance, best)
        v = ti.select(is_nearer, (t, 1.0 - t, 0.0)[edge], v)
        w = ti.select(is_nearer, (0.0, t, t)[edge], w)
    return ti.Vector([ti.max(1.0 - v - w, 0.0), v, w])


@ti.func
def pierce_triangle(a, b, c):
    """Intersect the z axis with a triangle.

    For a ray, use axes with the origin at the start of the ray and z along the ray. The test has a tolerance
    of float32's resolution at the distance of the triangle, so that no ray passes between two adjacent
    triangles. A triangle that is seen edge-on is not hit, but an adjacent triangle is.
    Args:
        a, b, c: vec3 [m].
    Returns: -1 if the axis passes through the triangle from front to back, 1 from back to front, 0 if it
        misses the triangle; and the weights of a, b and c at the hit, vec3 with sum 1. Seen from the front,
        a, b, c run counterclockwise.
    """
    areas = ti.Vector([b.x * c.y - b.y * c.x, c.x * a.y - c.y * a.x, a.x * b.y - a.y * b.x])
    across = ti.max(ti.abs(a.x), ti.abs(a.y), ti.abs(b.x), ti.abs(b.y), ti.abs(c.x), ti.abs(c.y))
    slack = 1e-6 * across * ti.max(across, ti.abs(a.z), ti.abs(b.z), ti.abs(c.z))
    side = ti.select(areas.sum() < 0.0, -1, 1)
    areas = areas * side
    if areas.sum() <= slack or areas.min() < -slack:
        side = 0
    areas = ti.max(areas, 0.0)
    return side, areas / ti.max(areas.sum(), _TINY)


@ti.func
def solid_angle(a, b, c):
    """Return the solid angle of a triangle seen from the origin [sr]; negative if the front is visible.

    For a closed surface that faces outward, the sum over its triangles is 4 pi if the origin is inside, and 0
    if the origin is outside (Van Oosterom and Strackee 1983).
    """
    la, lb, lc = a.norm(), b.norm(), c.norm()
    down = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb
    return 2.0 * atan2(a.dot(b.cross(c)), down)


@ti.func
def triangle_touches_box(a, b, c, half):
    """True if a triangle touches or overlaps the box from -half to half.

    The test uses separating axes: the normals of the box and of the triangle, and the cross products of the
    edges of both (Akenine-Moeller 2001). The axes are also valid for a triangle that is a segment or a point.
    """
    normal = (b - a).cross(c - a)
    heights = ti.Vector([normal.dot(a), normal.dot(b), normal.dot(c)])  # equal up to rounding
    reach = ti.abs(normal).dot(half)
    touches = spans_meet(a, b, c, half) and heights.max() >= -reach and heights.min() <= reach
    for edge in ti.static((b - a, c - b, a - c)):
        e = ti.abs(edge)
        reaches = e.yzx * half.zxy + e.zxy * half.yzx
        touches = touches and spans_meet(edge.cross(a), edge.cross(b), edge.cross(c), reaches)
    return touches


@ti.func
def spans_meet(a, b, c, reach):
    """True if the interval of a, b and c overlaps [-reach, reach] along each axis."""
    return ti.min(ti.max(a, b, c) + reach, reach - ti.min(a, b, c)).min() >= 0.0
