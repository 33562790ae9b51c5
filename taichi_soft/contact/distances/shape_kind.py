"""Numbers for the kinds of solids in kernels."""

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
"""Kinds of convex solids, whose signed distances are convex too: see `first_touch`."""
