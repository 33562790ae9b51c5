"""The shape of a sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.shape import Shape, Triangles, about_origin, as_length, triangles_of
from taichi_soft.core.serialisation import serialised


@serialised("radius")
@dataclass(frozen=True, eq=False)
class SphereShape(Shape):
    """A sphere centred on the origin.

    Args:
        radius: radius of the sphere [m], above 0.
    Raises: OptionError for a radius out of range.
    """

    kind = ShapeKind.SPHERE
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", as_length(self.radius, "radius"))

    def _values(self) -> tuple[float, ...]:
        return (self.radius,)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the bounding box, (2, 3) [m]."""
        return about_origin([self.radius] * 3)

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the surface, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        depths: NDArray[np.float64] = self.radius - np.linalg.norm(points, axis=1)
        return depths

    def surface(self) -> Triangles:
        """Return 1,280 triangles that approximate the sphere. Their vertices lie on the sphere."""
        import trimesh  # imported here, because the import takes half a second

        return triangles_of(trimesh.creation.icosphere(subdivisions=3, radius=self.radius))
