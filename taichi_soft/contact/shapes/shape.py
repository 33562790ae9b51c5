"""What all shapes have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.kinds import ShapeKind
from taichi_soft.core.checks import as_number
from taichi_soft.meshing.arrays import read_only

Triangles = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Vertices (n, 3) [m] and triangles (m, 3), counterclockwise seen from outside."""

SHORTEST, LONGEST = 1e-6, 1e6
"""Lengths of a shape [m] within which float32 resolves it."""


SEAM = 1e-4
"""Skin [m] on what has flat faces and edges. Where two of them meet flush, what lies on one is inside the
other by more than rounding, or it would slip into the seam between them."""


class Shape(ABC):
    """A solid in a frame of its own, immutable. Not made by itself: see `SphereShape` and its neighbours."""

    kind: ClassVar[ShapeKind]
    seam: ClassVar[float] = 0.0
    """Skin [m] beside the collider's thickness."""

    @abstractmethod
    def _values(self) -> tuple[float, ...]:
        """The numbers that the kind's distance function reads, at most 8."""

    @cached_property
    def parameters(self) -> NDArray[np.float32]:
        """What the distance function reads, float32 (8,)."""
        values = self._values()
        padded: NDArray[np.float32] = read_only(
            np.array([*values, *[0.0] * (8 - len(values))], dtype=np.float32)
        )
        return padded

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Nodes of the grid along each axis; zeros where there is none."""
        return (0, 0, 0)

    @property
    def samples(self) -> NDArray[np.float32]:
        """Values on the nodes of the grid, the last axis running fastest, float32 (k,)."""
        return _NO_SAMPLES

    @property
    @abstractmethod
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the solid in its own frame, (2, 3) [m]; infinite where it has no end."""

    @abstractmethod
    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points (n, 3) in its frame lie inside, (n,) [m], below 0 outside: about the way out.

        Args:
            points: in the frame of the shape, (n, 3) [m].
        """

    @abstractmethod
    def surface(self) -> Triangles:
        """What to draw: vertices (n, 3) [m] and triangles (m, 3), counterclockwise seen from outside."""


_NO_SAMPLES: NDArray[Any] = read_only(np.zeros(0, dtype=np.float32))


def as_length(value: Any, name: str, low: float = SHORTEST) -> float:
    """`value` as a length of a shape [m]. Raises: OptionError."""
    return as_number(value, name, low, LONGEST, f"a length from {low:g} to {LONGEST:g} m")


def about_origin(half: Any) -> NDArray[np.float64]:
    """Bounds of what reaches `half` (3,) to both sides of the origin."""
    corner = np.array(half, dtype=np.float64)
    bounds: NDArray[np.float64] = read_only(np.array([-corner, corner]))
    return bounds


def triangles_of(mesh: Any) -> Triangles:
    """Vertices and triangles of a trimesh.Trimesh."""
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int32)
