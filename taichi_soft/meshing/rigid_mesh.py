"""Rigid bodies as meshes: a surface, and one tetrahedron with the mass and the inertia of the solid.

Four equal masses at the corners of a tetrahedron can have any mass, centre and inertia of a solid. In the
frame of the principal axes, with the mean square S_i of the solid's coordinate i, these corners are at

    (+-sqrt(S_1), +-sqrt(S_2), +-sqrt(S_3)),  with an even number of minus signs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, as_indices, as_points, read_only
from taichi_soft.meshing.cage_mesh import CageMesh

SIGNS = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
"""Signs of the coordinates of the four corners, (4, 3), divided by `RigidMesh.radii`."""

_CORNERS = [[0, 1, 3, 2]]
"""Vertices of the tetrahedron, in an order for which its volume is positive."""

_SWEEPS = 30
_RESIDUE = 1e-10
"""Size of an off-diagonal number, relative to the trace, below which a matrix counts as diagonal. The axes of
symmetric bodies then stay the axes of their mesh, whatever the rounding."""


@serialised("points", "triangles")
class RigidMesh(CageMesh):
    """A rigid body: its closed surface, and four particles that carry its mass.

    Args:
        points: (h, 3) vertices of the surface at rest [m].
        triangles: (t, 3), indices of points, counterclockwise seen from outside.

    Attributes:
        center: (3,) centre of mass [m].
        radii: (3,), root mean square of the solid's coordinates along its principal axes [m].
        axes: (3, 3), principal axes as columns, a rotation.
        vertices: (4, 3), the particles: centre + axes (signs * radii).

    Raises: MeshError for invalid arrays, and for a surface that has a border, is flat or faces inwards.
    """

    points: FloatArray
    triangles: NDArray[np.int32]
    center: FloatArray
    radii: FloatArray
    axes: FloatArray

    def __init__(self, points: ArrayLike, triangles: ArrayLike) -> None:
        rows = as_points(points)
        corners = as_indices(triangles, "triangles", 3, len(rows), "triangle", may_repeat=False)
        require_closed(corners)
        volume, center, squares = _moments(rows, corners.astype(np.int64))
        axes, radii2 = _principal(squares)
        if not radii2.min() > 1e-8 * radii2.max():
            raise MeshError("the surface encloses a flat solid: give it a thickness")
        radii = np.sqrt(radii2)
        x, y, z = (SIGNS * radii).T[:, :, None]
        vertices = center + (axes[:, 0] * x + axes[:, 1] * y + axes[:, 2] * z)
        tet_volume = 8.0 / 3.0 * float(radii[0] * radii[1] * radii[2])
        super().__init__(vertices, _CORNERS, [volume / tet_volume], [volume / 4.0] * 4)
        self.__dict__.update(
            points=read_only(rows),
            triangles=read_only(corners.astype(np.int32)),
            center=read_only(center),
            radii=read_only(radii),
            axes=read_only(axes),
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return (RigidMesh, (self.points, self.triangles))

    def __repr__(self) -> str:
        return f"RigidMesh({len(self.points)} vertices, {len(self.triangles)} triangles)"

    def _with_vertices(self, vertices: FloatArray) -> RigidMesh:
        raise MeshError("a RigidMesh cannot be transformed: transform its surface, and make another")


def require_closed(triangles: NDArray[Any]) -> None:
    """Check that each edge belongs to two triangles that traverse it in opposite directions.

    Raises: MeshError.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).astype(
        np.int64
    )
    keys = edges @ [triangles.max() + 1, 1]
    back = edges[:, ::-1] @ [triangles.max() + 1, 1]
    unpaired = np.setdiff1d(keys, back)
    if len(unpaired) or len(np.unique(keys)) < len(keys):
        raise MeshError(
            f"the surface of a rigid body must be closed, but {max(len(unpaired), 1)} of its "
            f"{len(keys)} edges have no opposite edge: close its holes, merge equal vertices, or use its "
            "convex hull"
        )


def _moments(points: FloatArray, triangles: NDArray[np.int64]) -> tuple[float, FloatArray, FloatArray]:
    """Return volume [m^3], centre (3,) [m] and mean products of coordinates about the centre, (3, 3) [m^2].

    The solid is a sum of signed tetrahedra from a common point to each triangle.
    """
    origin = points.mean(axis=0)
    a, b, c = (points[triangles[:, k]] - origin for k in range(3))
    volumes = (a * np.cross(b, c)).sum(axis=1) / 6.0
    volume = float(volumes.sum())
    size = float(np.ptp(points, axis=0).max())
    if not volume > 1e-9 * size**3:
        raise MeshError(
            f"the surface encloses {volume:.3g} m^3: its triangles must be counterclockwise seen from outside"
        )
    total = a + b + c
    center = (volumes[:, None] * total).sum(axis=0) / (4.0 * volume)
    squares = np.zeros((3, 3))
    for i in range(3):
        for k in range(3):
            parts = total[:, i] * total[:, k] + a[:, i] * a[:, k] + b[:, i] * b[:, k] + c[:, i] * c[:, k]
            squares[i, k] = (volumes * parts).sum() / (20.0 * volume) - center[i] * center[k]
    return volume, origin + center, squares


def _principal(squares: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the eigenvectors of a symmetric matrix as the columns of a rotation, and the eigenvalues.

    The largest eigenvalue is first.

    Jacobi's method gives the same digits on every processor, in contrast to LAPACK.
    """
    matrix, axes = squares.copy(), np.eye(3)
    for _ in range(_SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if abs(matrix[p, q]) > _RESIDUE * np.trace(squares):
                half = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
                tangent = (1.0 if half >= 0.0 else -1.0) / (abs(half) + np.sqrt(half * half + 1.0))
                cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
                turn = np.eye(3)
                turn[p, p] = turn[q, q] = cosine
                turn[p, q], turn[q, p] = tangent * cosine, -tangent * cosine
                matrix = _product(_product(turn.T, matrix), turn)
                axes = _product(axes, turn)
    order = np.argsort(-np.diag(matrix), kind="stable")
    sign = 1.0 if order.tolist() in ([0, 1, 2], [1, 2, 0], [2, 0, 1]) else -1.0
    return axes[:, order] * [1.0, 1.0, sign], np.diag(matrix)[order]


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a b. The order of the additions is fixed."""
    return np.asarray((a[:, :, None] * b[None, :, :]).sum(axis=1))
