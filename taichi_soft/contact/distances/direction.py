"""Direction and length of a vector, with a fallback direction for zero length."""

from taichi_soft.core.runtime import ti

SHORTEST_SQUARED = 1e-24
"""Square of the smallest length whose direction is computed [m^2]: one picometre. Float32 underflows at
1e-38."""


@ti.func
def length_and_direction(v, fallback):
    """Return the length of a vec3 and its unit vector, or `fallback` if the vec3 is too short."""
    squared = v.dot(v)
    length = ti.sqrt(squared)
    unit = fallback
    if squared > SHORTEST_SQUARED:
        unit = v / length
    return length, unit
