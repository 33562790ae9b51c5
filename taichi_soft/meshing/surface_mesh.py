"""The surface of a body as a trimesh, to export as .glb, .obj, .ply or .stl, or to query."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import as_points
from taichi_soft.meshing.tet_mesh import TetMesh

if TYPE_CHECKING:
    import trimesh


def surface_mesh(mesh: TetMesh, positions: ArrayLike | None = None) -> trimesh.Trimesh:
    """Return the surface as a trimesh. Vertex i of the result is vertex `mesh.surface_vertices[i]`.

        surface_mesh(ball.mesh, ball.positions()).export("ball.glb")

    Args:
        mesh: tetrahedra of the body.
        positions: positions of all vertices, (n, 3) [m], such as `Body.positions()` returns; None for the
            rest shape.
    Returns: a `trimesh.Trimesh` with its own arrays. Triangles are counterclockwise seen from outside. z is
        up, also in exported files.
    Raises: MeshError if `mesh` is not a TetMesh, or if the number of positions does not match.
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"surface_mesh got a {type(mesh).__name__}: only a TetMesh has a surface")
    points = mesh.vertices if positions is None else as_points(positions, "positions")
    if len(points) != len(mesh.vertices):
        raise MeshError(f"{len(points)} positions for a mesh of {len(mesh.vertices)} vertices: pass one each")
    import trimesh  # slow to import, and games do not need it

    faces = np.searchsorted(mesh.surface_vertices, mesh.surface)
    return trimesh.Trimesh(points[mesh.surface_vertices], faces, process=False)
