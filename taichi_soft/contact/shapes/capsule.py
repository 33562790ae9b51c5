"""The shape of a capsule: a cylinder with round caps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.shape import Shape, Triangles, about_origin, as_length, triangles_of
from taichi_soft.core.serialisation import serialised


@serialised("radius", "length")
@dataclass(frozen=True, eq=False)
class CapsuleShape(Shape):
    """A capsule centred on the origin: all points within `radius` of a segment of the z axis.

    Args:
        radius: radius of the cylinder and the caps [m].
        length: distance between the centres of the caps [m], 0 or more. The capsule is `length + 2 * radius`
            long.
    Raises: OptionError for a radius or a length out of range.
    """

    kind = ShapeKind.CAPSULE
    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", as_length(self.radius, "radius"))
        object.__setattr__(self, "length", as_length(self.length, "length", low=0.0))

    def _values(self) -> tuple[float, ...]:
        return (self.radius, self.length / 2)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the bounding box, (2, 3) [m]."""
        return about_origin([self.radius, self.radius, self.length / 2 + self.radius])

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the surface, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        half = self.length / 2
        beside = points - np.clip(points, (0.0, 0.0, -half), (0.0, 0.0, half))
        depths: NDArray[np.float64] = self.radius - np.linalg.norm(beside, axis=1)
        return depths

    def surface(self) -> Triangles:
        """Return triangles that approximate the capsule. Their vertices lie on the capsule."""
        import trimesh  # imported here, because the import takes half a second

        return triangles_of(trimesh.creation.capsule(self.length, self.radius, count=(32, 32)))
