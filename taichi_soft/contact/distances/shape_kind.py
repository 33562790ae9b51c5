"""Kinds of solids in kernels."""

from enum import IntEnum


class ShapeKind(IntEnum):
    """Selects the distance function of a solid."""

    PLANE = 0
    SPHERE = 1
    BOX = 2
    CAPSULE = 3
    HEIGHT_FIELD = 4
    MESH = 5


CONVEX = frozenset({ShapeKind.PLANE, ShapeKind.SPHERE, ShapeKind.BOX, ShapeKind.CAPSULE})
"""Kinds whose solids and signed distances are always convex: see `first_touch`."""
