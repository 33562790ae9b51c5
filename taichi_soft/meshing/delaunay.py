"""Delaunay meshes: no vertex lies inside the sphere through a tetrahedron's corners (thesis section 4.1)."""

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
"""Largest valid depth of a vertex inside the circumsphere of a tetrahedron. The depth is the power of the
vertex with respect to the sphere, divided by the squared longest edge of the tetrahedron. The tolerance
allows for rounding if more than four vertices lie on a sphere, such as the eight corners of a cube."""


def scipy_spatial(purpose: str = "Voronoi graphs") -> Any:
    """Return the module scipy.spatial.

    Raises: MissingExtraError, which names `purpose`, if scipy is missing.
    """
    require_extra("voronoi", f"{purpose} need")
    from scipy import spatial

    return spatial


def circumspheres(mesh: TetMesh) -> tuple[FloatArray, FloatArray]:
    """Return the centres (m, 3) [m] and radii (m,) [m] of the spheres through each tetrahedron's corners."""
    x = mesh.vertices[mesh.tets]
    arms = x[:, 1:] - x[:, :1]
    offset = np.linalg.solve(arms, 0.5 * (arms**2).sum(axis=2)[:, :, None])[:, :, 0]
    return x[:, 0] + offset, np.linalg.norm(offset, axis=1)


def require_delaunay(mesh: TetMesh) -> None:
    """Check that no circumsphere contains a vertex. Raises: MeshError, which names the worst tetrahedron."""
    centers, radii = circumspheres(mesh)
    distance, nearest = scipy_spatial().cKDTree(mesh.vertices).query(centers)
    ends = mesh.vertices[mesh.tets]
    longest2 = ((ends[:, :, None] - ends[:, None]) ** 2).sum(axis=3).max(axis=(1, 2))
    power = (distance - radii) * (distance + radii) / longest2
    bad = np.flatnonzero(power < -TOLERANCE)
    if len(bad):
        worst = int(power.argmin())
        raise MeshError(
            f"the mesh is not Delaunay: vertex {nearest[worst]} lies inside the circumsphere of tetrahedron "
            f"{worst} ({len(bad)} of {len(mesh.tets)} tetrahedra fail): reconnect its vertices by "
            "delaunay_mesh(mesh)"
        )


def delaunay_mesh(mesh: TetMesh) -> TetMesh:
    """Reconnect the vertices of a mesh so that all circumspheres are empty. The body keeps its shape.

    Args:
        mesh: mesh of the body.
    Raises: MeshError if the surface of the body would change. The surface then needs more vertices.
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
        result = TetMesh(mesh.vertices, kept, fix_orientation=True)
    except MeshError as error:
        raise MeshError(
            f"the vertices of the mesh have no Delaunay mesh that fills the same body ({error}): put more "
            "vertices on its surface"
        ) from None
    if not np.isclose(result.volume, mesh.volume, rtol=1e-9):
        raise MeshError(
            f"the Delaunay mesh of these vertices fills {result.volume:.6g} m^3 instead of "
            f"{mesh.volume:.6g}: it does not keep the surface of the body; put more vertices on it"
        )
    return result


def _is_inside(mesh: TetMesh, points: FloatArray) -> FloatArray:
    """True for points (p, 3) that lie in a tetrahedron of the mesh."""
    corners = mesh.vertices[mesh.tets]
    inverses = edge_inverses(corners)
    is_inside = np.zeros(len(points), dtype=bool)
    for start in range(0, len(points), 256):
        offset = points[start : start + 256, None] - corners[None, :, 0]
        outside = shares_by(inverses, offset).min(axis=2) < -1e-9
        is_inside[start : start + 256] = ~outside.all(axis=1)
    return is_inside
