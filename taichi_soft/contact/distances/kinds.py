"""Kinds of solids, as kernels know them."""

from enum import IntEnum


class ShapeKind(IntEnum):
    """Which function measures the distance from a solid."""

    PLANE = 0
    SPHERE = 1
    BOX = 2
    CAPSULE = 3
    HEIGHT_FIELD = 4
    MESH = 5
