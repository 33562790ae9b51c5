"""Meshes of particles and edges, without volume, for cloth, ropes and spring lattices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import (
    FloatArray,
    IntArray,
    as_indices,
    as_points,
    as_real,
    name_vertices,
    read_only,
)
from taichi_soft.meshing.body_mesh import BodyMesh


@serialised("vertices", "edges", "masses", "surface")
class ParticleMesh(BodyMesh):
    """Mesh of particles and edges, with masses instead of a volume. It is immutable.

    Args:
        vertices: (n, 3) positions at rest [m].
        edges: (k, 2) integer vertex indices, in any order and direction. The rows are stored in this order,
            with i < j. Values per edge in a `SpringMaterial` have the same order.
        masses: (n,) mass of each particle [kg], above 0; or one number for all particles.
        surface: (f, 3) triangles to draw, none by default. Triangles are one-sided, so a sheet needs each
            triangle twice, once for each side.

    Raises: MeshError for wrong shapes or dtypes, numbers that are not finite, indices out of range, an edge
        from a vertex to itself, a duplicate edge, an edge of zero length, a vertex without an edge, a mass
        that is not positive, or a mesh without vertices or edges.

    The arrays are copied. `tets` is empty, (0, 4).
    """

    masses: FloatArray
    surface: IntArray

    def __init__(
        self, vertices: ArrayLike, edges: ArrayLike, masses: ArrayLike, *, surface: ArrayLike = ()
    ) -> None:
        points = as_points(vertices)
        pairs = np.sort(as_indices(edges, "edges", 2, len(points), "edge"), axis=1)
        order = np.lexsort((pairs[:, 1], pairs[:, 0]))
        in_order = pairs[order]
        same = (in_order[1:] == in_order[:-1]).all(axis=1)
        if same.any():
            first, second = sorted(order[int(np.argmax(same)) :][:2].tolist())
            raise MeshError(
                f"edges {first} and {second} join the same vertices ({name_vertices(pairs[first])}): "
                "remove one of them"
            )
        ends = points[pairs]
        is_zero = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) <= 0
        if is_zero.any():
            row = int(np.argmax(is_zero))
            raise MeshError(
                f"edge {row} has zero length (vertices {name_vertices(pairs[row])} coincide): "
                "merge the two vertices or move them apart"
            )
        isolated = np.bincount(pairs.ravel(), minlength=len(points)) == 0
        if isolated.any():
            raise MeshError(
                f"vertex {int(np.argmax(isolated))} belongs to no edge: remove it, or connect it to another"
            )
        super().__init__(points, pairs, np.zeros((0, 4), dtype=np.int32))
        mass = masses if hasattr(masses, "__len__") else np.full(len(points), masses)
        kilograms = as_real(mass, "masses", (len(points),), "mass")
        if not (kilograms > 0).all():
            row = int(np.argmax(kilograms <= 0))
            raise MeshError(f"mass {row} is {kilograms[row]:g} kg: every mass must be positive")
        triangles = np.zeros((0, 3), np.int32)
        if np.size(surface):
            triangles = as_indices(surface, "surface", 3, len(points), "triangle")
        self.__dict__.update(masses=read_only(kilograms), surface=read_only(triangles))

    def __reduce__(self) -> tuple[Any, ...]:
        # Copying and unpickling rebuild the mesh, so that its arrays are read-only again.
        return (_rebuilt, (self.vertices, self.edges, self.masses, self.surface))

    def _with_vertices(self, vertices: FloatArray) -> ParticleMesh:
        return _rebuilt(vertices, self.edges, self.masses, self.surface)


def _rebuilt(vertices: FloatArray, edges: IntArray, masses: FloatArray, surface: IntArray) -> ParticleMesh:
    return ParticleMesh(vertices, edges, masses, surface=surface)
