"""What cuts have left of an asset's mesh, in a few numbers, from which all else follows again."""

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
    """Some of the tetrahedra of an asset's mesh, and copies of its vertices."""

    vertices: Ints  # of the asset's mesh, that each vertex is or is a copy of, (n,)
    order: NDArray[np.int32]  # in which the kernels walk the vertices, (n,)
    tets: Ints  # of the asset's mesh, (m,)
    corners: NDArray[np.int32]  # vertices of each tetrahedron, (m, 4)

    @cached_property
    def rows(self) -> NDArray[np.int32]:
        """All of it, (2 n + 5 m,)."""
        parts = (self.vertices, self.order, self.tets, self.corners.ravel())
        return np.concatenate(parts).astype(np.int32)

    @cached_property
    def digest(self) -> str:
        """A name of it."""
        return blake2b(self.rows.astype("<i4").tobytes(), digest_size=8).hexdigest()

    @property
    def note(self) -> list[Any]:
        """Numbers of vertices and tetrahedra, and the digest."""
        return [len(self.vertices), len(self.tets), self.digest]

    @classmethod
    def of_rows(cls, rows: NDArray[np.int32], n: int, m: int) -> CutMesh:
        """What has these `rows`."""
        vertices, order, tets, corners = np.split(rows, [n, 2 * n, 2 * n + m])
        return cls(vertices.astype(np.int64), order, tets.astype(np.int64), corners.reshape(m, 4))

    def require_of(self, asset: SoftBodyAsset) -> None:
        """Raises: ValueError where no cut can have left it of an asset's mesh."""
        mesh, n = asset.mesh, len(self.vertices)
        if asset.spare_vertices == 0 or not isinstance(mesh, TetMesh) or n == 0 or len(self.tets) == 0:
            raise ValueError("a body was cut that cannot be")
        for numbers, limit in (
            (self.vertices, len(mesh.vertices)),
            (self.order, n),
            (self.tets, len(mesh.tets)),
            (self.corners, n),
        ):
            if numbers.min() < 0 or numbers.max() >= limit:
                raise ValueError("a cut names vertices or tetrahedra that there are not")
        rank = asset.arrays.rank[self.vertices[self.order]]
        is_whole = len(np.unique(self.tets)) == len(self.tets) and len(np.unique(self.corners)) == n
        is_ordered = len(np.unique(self.order)) == n and (np.diff(rank) >= 0).all()
        if not (is_whole and is_ordered and (self.vertices[self.corners] == mesh.tets[self.tets]).all()):
            raise ValueError("a cut has left what is no part of the mesh")

    def describe(self, asset: SoftBodyAsset, material: Any) -> BodyDescription:
        """A body of it."""
        whole = asset.description
        assert isinstance(whole.mesh, TetMesh)
        mesh = whole.mesh.part(self.vertices, self.corners, self.tets)
        pinned = np.flatnonzero(np.isin(self.vertices, whole.pinned)).astype(np.int32)
        return BodyDescription(mesh, material, whole.model, pinned)

    def arrange(self, asset: SoftBodyAsset, description: BodyDescription) -> BodyArrays:
        """The same in the order of the kernels."""
        return arrange_part(description, asset.arrays, self.vertices, self.tets, self.order)


def name_of(part: CutMesh | None) -> str:
    """Its digest; "" for a whole mesh."""
    return "" if part is None else part.digest
