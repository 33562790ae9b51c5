"""Cage meshes: tetrahedra around a solid. The solid fills the tetrahedra only partly."""

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
    """A tetrahedral mesh around a solid, such as `SoftBodyAsset.from_surface` makes.

    Args:
        vertices, tets: arguments of `TetMesh`.
        fill: volume of the solid that each tetrahedron carries, divided by the tetrahedron's volume, (m,),
            above 0. Stiffness and damping are multiplied by this ratio.
        vertex_volumes: volume of the solid that each vertex carries, (n,), above 0 [m^3].
    Raises: MeshError for invalid arguments of `TetMesh`, and for arrays of the wrong length or with values of
        0 or less.
    """

    def __init__(
        self, vertices: ArrayLike, tets: ArrayLike, fill: ArrayLike, vertex_volumes: ArrayLike
    ) -> None:
        super().__init__(vertices, tets)
        self._set_volumes(
            _positive(fill, "fill", len(self.tets), "tetrahedron"),
            _positive(vertex_volumes, "vertex_volumes", len(self.vertices), "vertex"),
        )

    def _set_volumes(self, fill: FloatArray, vertex_volumes: FloatArray) -> None:
        self.__dict__.update(fill=read_only(fill), vertex_volumes=read_only(vertex_volumes))

    def _inherit(self, original: TetMesh, vertices: NDArray[Any], rows: NDArray[Any]) -> None:
        # The volume of a vertex is divided among its copies, in proportion to the solid around each copy.
        before = lumped(original.tets, original.fill * original.volumes, len(original.vertices))
        after = lumped(self.tets, original.fill[rows] * self.volumes, len(vertices))
        self._set_volumes(original.fill[rows], original.vertex_volumes[vertices] * after / before[vertices])

    def __reduce__(self) -> tuple[Any, ...]:
        return (CageMesh, (self.vertices, self.tets, self.fill, self.vertex_volumes))

    def __repr__(self) -> str:
        solid = float(self.vertex_volumes.sum())
        return f"CageMesh({len(self.vertices)} vertices, {len(self.tets)} tetrahedra, solid {solid:.6g} m^3)"

    def _with_vertices(self, vertices: FloatArray) -> CageMesh:
        moved = TetMesh(vertices, self.tets)
        return CageMesh(vertices, self.tets, self.fill, self.vertex_volumes * (moved.volume / self.volume))


def lumped(tets: NDArray[Any], volumes: FloatArray, count: int) -> FloatArray:
    """Return the volume of each vertex, (n,) [m^3].

    A vertex gets a quarter of the volume of each tetrahedron around it.
    """
    return np.bincount(tets.ravel(), np.repeat(volumes / 4.0, 4), count).astype(np.float64)


def _positive(values: ArrayLike, name: str, count: int, element: str) -> FloatArray:
    array = as_real(values, name, (None,), element)
    if len(array) != count:
        raise MeshError(f"{name} has {len(array)} values: pass {count}, one for each {element}")
    if not (array > 0).all():
        row = int(np.argmin(array > 0))
        raise MeshError(f"{name} of {element} {row} is {array[row]:.6g}: every value must be above 0")
    return array
