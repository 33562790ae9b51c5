"""Base class of all shapes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.core.checks import as_number
from taichi_soft.meshing.arrays import read_only

Triangles = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Vertices (n, 3) [m] and triangles (m, 3), counterclockwise seen from outside."""

SHORTEST, LONGEST = 1e-6, 1e6
"""Smallest and largest length of a shape that float32 resolves [m]."""


SEAM = 1e-4
"""Skin on shapes with flat faces and edges [m]. The skins of two flush shapes overlap by more than rounding
errors, so that a body cannot slip into the joint between the shapes."""


class Shape(ABC):
    """An immutable solid in its own frame. This class is abstract: use `SphereShape` or another shape."""

    kind: ClassVar[ShapeKind]
    seam: ClassVar[float] = 0.0
    """Skin of the shape, which is added to the thickness of the collider [m]."""

    @abstractmethod
    def _values(self) -> tuple[float, ...]:
        """Return the parameters of the shape's distance function, at most 8 numbers."""

    @cached_property
    def parameters(self) -> NDArray[np.float32]:
        """Parameters of the distance function, float32 (8,)."""
        values = self._values()
        padded: NDArray[np.float32] = read_only(
            np.array([*values, *[0.0] * (8 - len(values))], dtype=np.float32)
        )
        return padded

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Number of nodes of the grid along each axis; (0, 0, 0) for a shape without a grid."""
        return (0, 0, 0)

    @property
    def samples(self) -> NDArray[np.float32]:
        """Values at the nodes of the grid, last axis fastest, float32 (k,); empty without a grid."""
        return _NO_SAMPLES

    @property
    @abstractmethod
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the bounding box in the shape's frame, (2, 3) [m]; infinite for an
        unbounded solid.
        """

    @abstractmethod
    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the surface, (n,) [m], negative outside.

        The depths of height fields and meshes are approximate.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """

    @abstractmethod
    def surface(self) -> Triangles:
        """Return vertices (n, 3) [m] and triangles (m, 3) to draw, counterclockwise seen from outside."""


_NO_SAMPLES: NDArray[Any] = read_only(np.zeros(0, dtype=np.float32))


def as_length(value: Any, name: str, low: float = SHORTEST) -> float:
    """Check that `value` is a length of a shape [m], and return it. Raises: OptionError."""
    return as_number(value, name, low, LONGEST, f"a length from {low:g} to {LONGEST:g} m")


def about_origin(half: Any) -> NDArray[np.float64]:
    """Return the bounds (2, 3) [m] of a solid that extends by `half` (3,) [m] on both sides of the origin."""
    corner = np.array(half, dtype=np.float64)
    bounds: NDArray[np.float64] = read_only(np.array([-corner, corner]))
    return bounds


def triangles_of(mesh: Any) -> Triangles:
    """Return vertices and triangles of a trimesh.Trimesh."""
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int32)
