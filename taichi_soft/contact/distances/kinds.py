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


CONVEX = frozenset({ShapeKind.PLANE, ShapeKind.SPHERE, ShapeKind.BOX, ShapeKind.CAPSULE})
"""Kinds of which every solid is convex, and its signed distance too: see `first_touch`."""
