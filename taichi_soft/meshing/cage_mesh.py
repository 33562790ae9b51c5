"""Tetrahedra that stand for a solid which does not fill them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, as_real, read_only
from taichi_soft.meshing.tet_mesh import TetMesh


@serialised("vertices", "tets", "fill", "vertex_volumes")
class CageMesh(TetMesh):
    """A tetrahedral mesh round a solid, such as `SoftBodyAsset.from_surface` makes.

    Args:
        vertices, tets: as of a `TetMesh`.
        fill: volume of the solid that each tetrahedron carries, over its own, (m,), above 0. It is as much
            stiffer, and damps as much more, than one that is full.
        vertex_volumes: volume of the solid that each vertex carries, (n,), above 0 [m^3].
    Raises: MeshError as `TetMesh` does, and for values that do not fit.
    """

    def __init__(
        self, vertices: ArrayLike, tets: ArrayLike, fill: ArrayLike, vertex_volumes: ArrayLike
    ) -> None:
        super().__init__(vertices, tets)
        self._carry(
            _positive(fill, "fill", len(self.tets), "tetrahedron"),
            _positive(vertex_volumes, "vertex_volumes", len(self.vertices), "vertex"),
        )

    def _carry(self, fill: FloatArray, vertex_volumes: FloatArray) -> None:
        self.__dict__.update(fill=read_only(fill), vertex_volumes=read_only(vertex_volumes))

    def _inherit(self, whole: TetMesh, vertices: NDArray[Any], rows: NDArray[Any]) -> None:
        # Copies of a vertex share what it carried by what is round each.
        before = lumped(whole.tets, whole.fill * whole.volumes, len(whole.vertices))
        after = lumped(self.tets, whole.fill[rows] * self.volumes, len(vertices))
        self._carry(whole.fill[rows], whole.vertex_volumes[vertices] * after / before[vertices])

    def __reduce__(self) -> tuple[Any, ...]:
        return (CageMesh, (self.vertices, self.tets, self.fill, self.vertex_volumes))

    def __repr__(self) -> str:
        solid = float(self.vertex_volumes.sum())
        return f"CageMesh({len(self.vertices)} vertices, {len(self.tets)} tetrahedra, solid {solid:.6g} m^3)"

    def _with_vertices(self, vertices: FloatArray) -> CageMesh:
        moved = TetMesh(vertices, self.tets)
        return CageMesh(vertices, self.tets, self.fill, self.vertex_volumes * (moved.volume / self.volume))


def lumped(tets: NDArray[Any], volumes: FloatArray, count: int) -> FloatArray:
    """A quarter of each tetrahedron's volume to each of its vertices, (n,) [m^3]."""
    return np.bincount(tets.ravel(), np.repeat(volumes / 4.0, 4), count).astype(np.float64)


def _positive(values: ArrayLike, name: str, count: int, what: str) -> FloatArray:
    array = as_real(values, name, (None,), what)
    if len(array) != count:
        raise MeshError(f"{name} has {len(array)} values: give one for each {what}, {count}")
    if not (array > 0).all():
        row = int(np.argmin(array > 0))
        raise MeshError(f"{name} of {what} {row} is {array[row]:.6g}: every one must be above 0")
    return array
