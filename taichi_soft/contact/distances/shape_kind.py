"""Numbers by which kernels distinguish the kinds of solids."""

from enum import IntEnum


class ShapeKind(IntEnum):
    """Kind of a solid, which selects its distance function."""

    PLANE = 0
    SPHERE = 1
    BOX = 2
    CAPSULE = 3
    HEIGHT_FIELD = 4
    MESH = 5


CONVEX = frozenset({ShapeKind.PLANE, ShapeKind.SPHERE, ShapeKind.BOX, ShapeKind.CAPSULE})
"""Kinds of convex solids. The signed distance from a convex solid is a convex function: see `first_touch`."""
