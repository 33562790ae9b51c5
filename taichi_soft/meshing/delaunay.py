"""Delaunay or not: whether the sphere through each tetrahedron's corners is empty (thesis section 4.1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.core.extras import require_extra
from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.quality import FLATTEST
from taichi_soft.meshing.tet_mesh import TetMesh

TOLERANCE = 1e-6
"""How far a vertex may be inside a sphere, as its power over the square of the longest edge: a cube's eight
corners lie on one sphere but for rounding."""


def scipy_spatial(purpose: str = "Voronoi graphs") -> Any:
    """scipy.spatial. Raises: MissingExtraError with the purpose."""
    require_extra("voronoi", f"{purpose} need")
    from scipy import spatial

    return spatial


def circumspheres(mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
    """Centres (m, 3) [m] and radii (m,) [m] of the spheres through each tetrahedron's corners."""
    x = mesh.vertices[mesh.tets]
    arms = x[:, 1:] - x[:, :1]
    offset = np.linalg.solve(arms, 0.5 * (arms**2).sum(axis=2)[:, :, None])[:, :, 0]
    return x[:, 0] + offset, np.linalg.norm(offset, axis=1)


def require_delaunay(mesh: TetMesh) -> None:
    """Raises: MeshError naming the worst tetrahedron where a circumsphere is not empty."""
    centers, radii = circumspheres(mesh)
    distance, nearest = scipy_spatial().cKDTree(mesh.vertices).query(centers)
    ends = mesh.vertices[mesh.tets]
    longest2 = ((ends[:, :, None] - ends[:, None]) ** 2).sum(axis=3).max(axis=(1, 2))
    power = (distance - radii) * (distance + radii) / longest2
    bad = np.flatnonzero(power < -TOLERANCE)
    if len(bad):
        worst = int(power.argmin())
        raise MeshError(
            f"the mesh is not Delaunay: vertex {nearest[worst]} lies inside the sphere round tetrahedron "
            f"{worst} ({len(bad)} of {len(mesh.tets)} are such): delaunay_mesh(mesh) connects the same "
            "vertices anew"
        )


def delaunay_mesh(mesh: TetMesh) -> TetMesh:
    """The same vertices in the same body, connected so that all circumspheres are empty.

    Args:
        mesh: tetrahedra whose surface stays as it is.
    Raises: MeshError where the surface of the body cannot be kept: it then needs more vertices.
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"mesh must be a TetMesh, got {type(mesh).__name__}")
    tets = scipy_spatial().Delaunay(mesh.vertices).simplices.astype(np.int64)
    corners = mesh.vertices[tets]
    arms = corners[:, 1:] - corners[:, :1]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    solid = np.abs(np.linalg.det(arms)) / 6 > 10 * FLATTEST * longest**3
    tets = tets[solid]
    kept = tets[_is_inside(mesh, corners[solid].mean(axis=1))]
    try:
        made = TetMesh(mesh.vertices, kept, fix_orientation=True)
    except MeshError as error:
        raise MeshError(
            f"the vertices of the mesh have no Delaunay mesh of the same body ({error})"
        ) from None
    if not np.isclose(made.volume, mesh.volume, rtol=1e-9):
        raise MeshError(
            f"a Delaunay mesh of the same vertices fills {made.volume:.6g} m^3 instead of {mesh.volume:.6g}: "
            "its surface is not that of the body; put more vertices on it"
        )
    return made


def _is_inside(mesh: TetMesh, points: FloatArray) -> FloatArray:
    """Which of (p, 3) points lie in any tetrahedron."""
    corners = mesh.vertices[mesh.tets]
    inverses = edge_inverses(corners)
    found = np.zeros(len(points), dtype=bool)
    for start in range(0, len(points), 256):
        arm = points[start : start + 256, None] - corners[None, :, 0]
        outside = shares_by(inverses, arm).min(axis=2) < -1e-9
        found[start : start + 256] = ~outside.all(axis=1)
    return found
