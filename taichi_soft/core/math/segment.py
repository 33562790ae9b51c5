"""Geometry of two line segments."""

from taichi_soft.core.runtime import ti

_TINY = 1e-37
"""Lower limit of divisors."""


@ti.func
def closest_points_on_segments(p, d, q, e):
    """Find the points of two segments that are closest to each other (Ericson 2005, section 5.1.9).

    Args:
        p, q: first ends, vec3 [m].
        d, e: vectors from the first to the second ends, vec3 [m].
    Returns: fractions s and t, each from 0 to 1: the points are p + s d and q + t e.
    """
    r = p - q
    a, b, c = d.dot(d), d.dot(e), e.dot(e)
    along, across = d.dot(r), e.dot(r)
    s = ti.min(ti.max((b * across - c * along) / ti.max(a * c - b * b, _TINY), 0.0), 1.0)
    t = ti.min(ti.max((b * s + across) / ti.max(c, _TINY), 0.0), 1.0)
    s = ti.min(ti.max((b * t - along) / ti.max(a, _TINY), 0.0), 1.0)
    return s, t
