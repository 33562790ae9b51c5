"""The point of a triangle nearest to another point."""

from taichi_soft.core.runtime import ti

FLATTEST_SQUARED = 1e-8
"""Squared ratio of a triangle's height to its length below which float32 cannot resolve the normal. Such a
triangle is treated as three segments."""


@ti.func
def nearest_on_segment(p, a, b):
    """Return the point nearest to `p` on the segment from `a` to `b`, which can have zero length."""
    along = b - a
    t = (p - a).dot(along) / ti.max(along.dot(along), 1e-30)
    return a + ti.max(0.0, ti.min(1.0, t)) * along


@ti.func
def nearest_on_triangle(p, a, b, c):
    """Return the point nearest to `p` on the triangle `a`, `b`, `c`, which can be degenerate."""
    normal = (b - a).cross(c - a)
    squared = normal.dot(normal)
    longest = ti.max((b - a).dot(b - a), (c - a).dot(c - a))
    over = ti.min(
        normal.cross(b - a).dot(p - a), normal.cross(c - b).dot(p - b), normal.cross(a - c).dot(p - c)
    )
    nearest = a
    if over >= 0.0 and squared > FLATTEST_SQUARED * longest * longest:
        nearest = p - normal * ((p - a).dot(normal) / squared)
    else:
        nearest = nearest_on_segment(p, a, b)
        second = nearest_on_segment(p, b, c)
        if (p - second).norm_sqr() < (p - nearest).norm_sqr():
            nearest = second
        third = nearest_on_segment(p, c, a)
        if (p - third).norm_sqr() < (p - nearest).norm_sqr():
            nearest = third
    return nearest
