"""Unit vectors that exist everywhere."""

from taichi_soft.core.runtime import ti

SHORTEST_SQUARED = 1e-24
"""Of a vector that still has a direction [m^2]: a picometre's; float32 underflows at 1e-38."""


@ti.func
def length_and_direction(v, fallback):
    """Length of a vec3 and the unit vector along it, or `fallback` where it is too short to have one."""
    squared = v.dot(v)
    length = ti.sqrt(squared)
    unit = fallback
    if squared > SHORTEST_SQUARED:
        unit = v / length
    return length, unit
