"""Direction and length of a vector, with a fallback direction for zero length."""

from taichi_soft.core.runtime import ti

SHORTEST_SQUARED = 1e-24
"""Smallest squared length of a vector whose direction is computed [m^2]. The length is 1 pm. Float32
underflows at 1e-38."""


@ti.func
def length_and_direction(v, fallback):
    """Return the length of `v` (vec3) and its direction. If `v` is too short, the direction is `fallback`."""
    squared = v.dot(v)
    length = ti.sqrt(squared)
    unit = fallback
    if squared > SHORTEST_SQUARED:
        unit = v / length
    return length, unit
