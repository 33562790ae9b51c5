"""Convert a caller's mesh to the closed surface of a solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.shapes.shape import LONGEST, SHORTEST
from taichi_soft.core.errors import MeshError
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.advice import scene_hint, with_install_hint
from taichi_soft.meshing.arrays import FloatArray, IntArray, as_indices, as_points, name_vertices

FLATTEST = 1e-9
"""Smallest volume of a mesh, relative to the cube of its longest side. A smaller volume can be a rounding
error."""


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A closed surface of triangles, which separates inside from outside."""

    vertices: FloatArray  # (n, 3) [m], without duplicates
    triangles: IntArray  # (f, 3), counterclockwise seen from outside

    @property
    def bounds(self) -> FloatArray:
        """Lower and upper corner of the bounding box, (2, 3) [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])


def closed_mesh(source: Any) -> ClosedMesh:
    """Return the surface of a trimesh.Trimesh or TetMesh, or of a pair (vertices, triangles).

    Vertices at the same position are merged. Triangles that become lines are removed.
    Raises: MeshError if `source` is none of these, or if its surface is open, faces inward or encloses no
    volume.
    """
    vertices, triangles = _arrays(source)
    points = as_points(vertices)
    named = as_indices(triangles, "triangles", 3, len(points), "triangle")
    numbers, rows = np.unique(named, return_inverse=True)
    _, first, place = np.unique(points[numbers] + 0.0, axis=0, return_index=True, return_inverse=True)
    numbers, merged = numbers[first], place.reshape(-1)[rows.reshape(-1, 3)]
    a, b, c = merged.T
    corners = merged[(a != b) & (b != c) & (c != a)].astype(np.int32)
    _require_closed(corners, numbers)
    mesh = ClosedMesh(points[numbers], corners)
    _require_volume(mesh)
    return mesh


def _arrays(source: Any) -> tuple[Any, Any]:
    if isinstance(source, TetMesh):
        return source.vertices, source.surface
    if isinstance(source, (tuple, list)) and len(source) == 2:
        return source[0], source[1]
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return source.vertices, source.faces
    raise MeshError(
        "a mesh shape is made of a trimesh.Trimesh, a TetMesh or (vertices, triangles), got "
        f"{type(source).__name__}{scene_hint(source)}"
    )


def _require_closed(triangles: IntArray, numbers: NDArray[Any]) -> None:
    """Check that the surface has no border: its triangles use each edge equally often in both directions.

    Raises: MeshError.
    """
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    pairs, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    uses = np.bincount(edge.reshape(-1), minlength=len(pairs))
    balance = np.bincount(edge.reshape(-1), np.where(ends[:, 0] < ends[:, 1], 1, -1), len(pairs))
    odd = uses % 2 == 1
    if odd.any():
        raise MeshError(
            f"the mesh is open: {odd.sum()} edges such as that of vertices "
            f"{name_vertices(numbers[pairs[odd.argmax()]])} belong to one triangle only. Close it, for "
            f"example by {with_install_hint('trimesh.repair.fill_holes(mesh)', 'networkx')}, or give a "
            "sheet a thickness"
        )
    bad = balance != 0
    if bad.any():
        raise MeshError(
            f"triangles at the edge of vertices {name_vertices(numbers[pairs[bad.argmax()]])} face opposite "
            f"ways: turn them by {with_install_hint('mesh.fix_normals()', 'networkx', 'scipy')}"
        )


def _require_volume(mesh: ClosedMesh) -> None:
    low, high = mesh.bounds if len(mesh.triangles) else np.zeros((2, 3))
    longest = float((high - low).max())
    if len(mesh.triangles) and not SHORTEST <= longest <= LONGEST:
        raise MeshError(
            f"the mesh is {longest:g} m long: scale it to metres, from {SHORTEST:g} to {LONGEST:g} m"
        )
    a, b, c = np.moveaxis((mesh.vertices - low)[mesh.triangles], 1, 0)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    if abs(volume) <= FLATTEST * longest**3:
        raise MeshError(f"the mesh encloses no volume ({volume:.2g} m^3): give it a thickness")
    if volume < 0:
        raise MeshError(f"the mesh is inside out (volume {volume:.3g} m^3): turn it by mesh.invert()")
