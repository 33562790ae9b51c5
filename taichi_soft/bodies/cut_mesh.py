"""Mesh of a body after cuts, stored as the integers from which the body's arrays can be rebuilt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.layout import BodyArrays, arrange_part
from taichi_soft.meshing import TetMesh

if TYPE_CHECKING:
    from taichi_soft.bodies.asset import SoftBodyAsset

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A subset of the tetrahedra of an asset's mesh, with vertices that cuts have copied."""

    vertices: Ints  # (n,), original of each vertex in the asset's mesh
    order: NDArray[np.int32]  # (n,), order of the vertices in the kernels
    tets: Ints  # (m,), index of each tetrahedron in the asset's mesh
    corners: NDArray[np.int32]  # (m, 4), vertices of each tetrahedron

    @cached_property
    def rows(self) -> NDArray[np.int32]:
        """Concatenation of the four arrays of the mesh, (2 n + 5 m,)."""
        parts = (self.vertices, self.order, self.tets, self.corners.ravel())
        return np.concatenate(parts).astype(np.int32)

    @cached_property
    def digest(self) -> str:
        """Hash of `rows`, in hexadecimal."""
        return blake2b(self.rows.astype("<i4").tobytes(), digest_size=8).hexdigest()

    @property
    def summary(self) -> list[Any]:
        """Number of vertices, number of tetrahedra, and the digest."""
        return [len(self.vertices), len(self.tets), self.digest]

    @classmethod
    def of_rows(cls, rows: NDArray[np.int32], n: int, m: int) -> CutMesh:
        """Rebuild a mesh with n vertices and m tetrahedra from its `rows`."""
        vertices, order, tets, corners = np.split(rows, [n, 2 * n, 2 * n + m])
        return cls(vertices.astype(np.int64), order, tets.astype(np.int64), corners.reshape(m, 4))

    def require_part_of(self, asset: SoftBodyAsset) -> None:
        """Check that this mesh can result from cuts of an asset's mesh. Raises: ValueError."""
        mesh, n = asset.mesh, len(self.vertices)
        if asset.spare_vertices == 0 or not isinstance(mesh, TetMesh) or n == 0 or len(self.tets) == 0:
            raise ValueError("a body is cut that cannot be cut")
        for numbers, limit in (
            (self.vertices, len(mesh.vertices)),
            (self.order, n),
            (self.tets, len(mesh.tets)),
            (self.corners, n),
        ):
            if numbers.min() < 0 or numbers.max() >= limit:
                raise ValueError("a cut names vertices or tetrahedra that do not exist")
        rank = asset.arrays.rank[self.vertices[self.order]]
        is_complete = len(np.unique(self.tets)) == len(self.tets) and len(np.unique(self.corners)) == n
        is_ordered = len(np.unique(self.order)) == n and (np.diff(rank) >= 0).all()
        if not (is_complete and is_ordered and (self.vertices[self.corners] == mesh.tets[self.tets]).all()):
            raise ValueError("a cut body is not a part of its mesh")

    def describe(self, asset: SoftBodyAsset, material: Any) -> BodyDescription:
        """Return the description of a body with this mesh and `material`."""
        original = asset.description
        assert isinstance(original.mesh, TetMesh)
        mesh = original.mesh.part(self.vertices, self.corners, self.tets)
        pinned = np.flatnonzero(np.isin(self.vertices, original.pinned)).astype(np.int32)
        return BodyDescription(mesh, material, original.model, pinned)

    def arrange(self, asset: SoftBodyAsset, description: BodyDescription) -> BodyArrays:
        """Return the arrays of a body with this mesh, in kernel order."""
        return arrange_part(description, asset.arrays, self.vertices, self.tets, self.order)


def name_of(part: CutMesh | None) -> str:
    """Return the digest of a cut mesh; "" for None, an uncut mesh."""
    return "" if part is None else part.digest
