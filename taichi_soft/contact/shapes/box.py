"""The shape of a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.shape import SEAM, Shape, Triangles, about_origin, as_length, triangles_of
from taichi_soft.core.checks import as_array
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import read_only


@serialised("size")
@dataclass(frozen=True, eq=False)
class BoxShape(Shape):
    """A box centred on the origin, with edges along the axes.

    Args:
        size: lengths of the edges along x, y and z, (3,) [m].
    Raises: OptionError for a size out of range.
    """

    kind = ShapeKind.BOX
    seam = SEAM
    size: ArrayLike

    def __post_init__(self) -> None:
        size = as_array(self.size, "size", (3,), "m")
        edges = [as_length(edge, f"size along {axis}") for edge, axis in zip(size, "xyz", strict=True)]
        object.__setattr__(self, "size", read_only(np.array(edges)))

    def _values(self) -> tuple[float, ...]:
        x, y, z = np.asarray(self.size) / 2
        return (x, y, z)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the box, (2, 3) [m]."""
        return about_origin(np.asarray(self.size) / 2)

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the nearest face, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        depths: NDArray[np.float64] = (np.asarray(self.size) / 2 - np.abs(points)).min(axis=1)
        return depths

    def surface(self) -> Triangles:
        """Return the triangles of the box, two per face."""
        import trimesh  # imported here, because the import takes half a second

        return triangles_of(trimesh.creation.box(np.asarray(self.size)))
