"""Unit vectors with a fallback for zero length."""

from taichi_soft.core.runtime import ti

SHORTEST_SQUARED = 1e-24
"""Square of the shortest length that still has a direction [m^2]: one picometre; float32 underflows at
1e-38."""


@ti.func
def length_and_direction(v, fallback):
    """Length of a vec3 and its unit vector, or `fallback` if it is too short."""
    squared = v.dot(v)
    length = ti.sqrt(squared)
    unit = fallback
    if squared > SHORTEST_SQUARED:
        unit = v / length
    return length, unit
