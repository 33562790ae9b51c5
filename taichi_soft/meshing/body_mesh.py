"""Base class of all meshes of bodies. A mesh consists of particles and the edges between them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.core.checks import as_array, as_positive, as_rotation
from taichi_soft.meshing.arrays import FloatArray, IntArray, read_only

Self = TypeVar("Self", bound="BodyMesh")


class BodyMesh(ABC):
    """Particles and edges of a body at rest. The subclasses are `TetMesh`, `ParticleMesh`, `ShellMesh` and
    `RodMesh`.

    A mesh is immutable: attributes cannot be set, arrays are read-only, and `translated`, `scaled` and
    `rotated` return new meshes.

    Attributes:
        vertices: float64 (n, 3), positions at rest [m].
        edges: int32 (k, 2), vertex indices (i, j) with i < j. Rows of a `TetMesh` are in ascending order.
        tets: int32 (m, 4), vertex indices of the tetrahedra; m = 0 for other meshes than a `TetMesh`.
        surface: int32 (f, 3), triangles of the surface; f = 0 for a rope.
    """

    vertices: FloatArray
    edges: IntArray
    tets: IntArray
    surface: IntArray

    def __init__(self, vertices: FloatArray, edges: IntArray, tets: IntArray) -> None:
        # Writing to __dict__ bypasses __setattr__ below. cached_property does the same.
        self.__dict__.update(vertices=read_only(vertices), edges=read_only(edges), tets=read_only(tets))

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(
            f"{type(self).__name__} is immutable: make a new one instead of setting {name!r}"
        )

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} is immutable: {name!r} cannot be deleted")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.vertices)} vertices, {len(self.edges)} edges)"

    @abstractmethod
    def _with_vertices(self: Self, vertices: FloatArray) -> Self:
        """Return a copy of this mesh with other positions."""

    @cached_property
    def edge_lengths(self) -> FloatArray:
        """Length of every edge at rest, float64 (k,) [m]."""
        ends = self.vertices[self.edges]
        lengths: FloatArray = read_only(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
        return lengths

    @property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the bounding box, float64 (2, 3) [m]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def translated(self: Self, offset: ArrayLike) -> Self:
        """Return a copy moved by `offset`.

        Args:
            offset: displacement, (3,) [m].
        Raises: OptionError if `offset` is not three finite numbers.
        """
        return self._with_vertices(self.vertices + as_array(offset, "offset", (3,), "m"))

    def scaled(self: Self, factor: float) -> Self:
        """Return a copy scaled about the origin.

        Args:
            factor: scale factor, above 0.
        Raises: OptionError if `factor` is not positive.
        """
        return self._with_vertices(self.vertices * as_positive(factor, "factor", "(one number)"))

    def rotated(self: Self, rotation: ArrayLike) -> Self:
        """Return a copy rotated about the origin.

        Args:
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError if `rotation` is not a rotation.
        """
        return self._with_vertices(self.vertices @ as_rotation(rotation).T)
