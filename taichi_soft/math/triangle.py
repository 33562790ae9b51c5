"""Geometry of one triangle: what is nearest, what a line of sight meets, how much of the view it fills."""

from taichi_soft.runtime import ti

_TINY = 1e-37
"""Least divisor: what is smaller is a length of zero in float32, and its numerator is then zero too."""


@ti.func
def closest_point_on_triangle(x, a, b, c):
    """Barycentric coordinates of the triangle's point nearest to x, vec3.

    The nearest of the projection onto the plane, where that falls inside, and of the nearest points of the
    three edges. Each is a point of the triangle whatever the rounding, so flat triangles, down to a segment
    or a point, are no special case.
    Args:
        x, a, b, c: vec3 [m].
    Returns: weights of a, b and c, each from 0 to 1, of sum 1.
    """
    ab, ac, ax = b - a, c - a, x - a
    bc, bx = c - b, x - b
    n = ab.cross(ac)
    scale = 1.0 / ti.max(n.dot(n), _TINY)
    v, w = ax.cross(ac).dot(n) * scale, ab.cross(ax).dot(n) * scale
    is_inside = ti.min(v, w, 1.0 - v - w) >= 0.0
    v, w = ti.select(is_inside, v, 0.0), ti.select(is_inside, w, 0.0)  # otherwise a
    gap = ax - ab * v - ac * w
    best = gap.dot(gap)
    for edge in ti.static(range(3)):
        away, along = ((ax, ab), (bx, bc), (ax, ac))[edge]
        t = ti.min(ti.max(away.dot(along) / ti.max(along.dot(along), _TINY), 0.0), 1.0)
        gap = away - along * t
        distance = gap.dot(gap)
        if distance < best:
            best = distance
            v = (t, 1.0 - t, 0.0)[edge]
            w = (0.0, t, t)[edge]
    return ti.Vector([ti.max(1.0 - v - w, 0.0), v, w])
