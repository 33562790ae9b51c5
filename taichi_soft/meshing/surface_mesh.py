"""The surface of a body as a trimesh: to write it as .glb, .obj, .ply or .stl, or to ask about it."""

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
    """The surface at rest, or where `positions` say; its vertex i is vertex `mesh.surface_vertices[i]`.

        surface_mesh(ball.mesh, ball.positions()).export("ball.glb")

    Args:
        mesh: whose surface.
        positions: of all vertices, (n, 3) [m], such as `Body.positions()` gives; None takes the rest shape.
    Returns: a `trimesh.Trimesh` of its own arrays, triangles counterclockwise seen from outside. z is up,
        in files too.
    Raises: MeshError for something else than a TetMesh or positions that do not fit.
    """
    if not isinstance(mesh, TetMesh):
        raise MeshError(f"surface_mesh got a {type(mesh).__name__}: only a TetMesh has a surface")
    points = mesh.vertices if positions is None else as_points(positions, "positions")
    if len(points) != len(mesh.vertices):
        raise MeshError(f"{len(points)} positions for a mesh of {len(mesh.vertices)} vertices: give one each")
    import trimesh  # half a second that a game need not wait for

    faces = np.searchsorted(mesh.surface_vertices, mesh.surface)
    return trimesh.Trimesh(points[mesh.surface_vertices], faces, process=False)
