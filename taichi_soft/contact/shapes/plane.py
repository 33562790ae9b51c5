"""The shape of an infinite plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.shape import Shape, Triangles, about_origin, as_length
from taichi_soft.core.checks import as_vector
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import read_only


@serialised("normal")
@dataclass(frozen=True, eq=False)
class PlaneShape(Shape):
    """The solid half-space below a plane through the origin.

    Args:
        normal: direction away from the solid, (3,), of any length.
    Raises: OptionError for a normal shorter than 1e-9.
    """

    kind = ShapeKind.PLANE
    normal: ArrayLike = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        normal = as_vector(self.normal, "normal", "")
        length = np.linalg.norm(normal)
        if length < 1e-9:
            raise OptionError(f"normal must be longer than 1e-9, got {normal.tolist()}")
        object.__setattr__(self, "normal", read_only(normal / length))

    def _values(self) -> tuple[float, ...]:
        x, y, z = np.asarray(self.normal)
        return (x, y, z)

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the bounds, infinite in all directions, (2, 3) [m]."""
        return about_origin((np.inf, np.inf, np.inf))

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the plane, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        depths: NDArray[np.float64] = -points @ np.asarray(self.normal)
        return depths

    def surface(self, size: float = 20.0) -> Triangles:
        """Return two triangles that form a square in the plane, centred on the origin.

        Args:
            size: edge of the square [m]; 20 m by default.
        """
        half = as_length(size, "size") / 2
        normal = np.asarray(self.normal)
        across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        across /= np.linalg.norm(across)
        along = np.cross(normal, across)
        corners = [-across - along, across - along, across + along, along - across]
        return half * np.array(corners), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
