"""Triangle meshes of shells: cloth, paper, thin walls."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_array, as_positive
from taichi_soft.core.errors import MeshError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, IntArray, as_indices, as_points, name_vertices, read_only
from taichi_soft.meshing.body_mesh import BodyMesh
from taichi_soft.meshing.lattices import as_cells
from taichi_soft.meshing.surface import joined
from taichi_soft.meshing.surfaces import Up, read_surfaces
from taichi_soft.meshing.welding import welded

FLATTEST = 1e-6
"""Smallest height of a triangle, as a fraction of its longest edge. Flatter triangles need substeps that no
game can afford."""


@serialised("vertices", "triangles")
class ShellMesh(BodyMesh):
    """Mesh of a thin body: triangles that are connected along their edges. It is immutable.

    The shape of the mesh is the shape at rest, flat or curved. The orientation of triangles has no effect.

    Args:
        vertices: (n, 3) positions at rest [m].
        triangles: (m, 3) integer vertex indices.

    Raises: MeshError for wrong shapes or dtypes, numbers that are not finite, indices out of range, a
        triangle without area, two equal triangles, an edge of more than two triangles, a vertex without a
        triangle, or a mesh without triangles.

    Attributes:
        triangles: int32 (m, 3), the triangles as given.
        edges: int32 (k, 2), the edges of the triangles.
        surface: int32 (2 m, 3), each triangle once for each side.
        areas: float64 (m,), area of each triangle at rest [m^2].

    The arrays are copied. `tets` is empty, (0, 4).
    Example:
        tent = ShellMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.5)], [(0, 1, 2), (1, 3, 2)])
    """

    triangles: IntArray
    surface: IntArray
    areas: FloatArray

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        points = as_points(vertices)
        rows = as_indices(triangles, "triangles", 3, len(points), "triangle")
        areas = _checked_areas(points, rows)
        pairs, count = np.unique(half_edges(rows), axis=0, return_counts=True)
        if count.max() > 2:
            row = int(count.argmax())
            raise MeshError(
                f"the edge of vertices {name_vertices(pairs[row])} belongs to {count[row]} triangles: a "
                "shell has at most two at each edge. Remove triangles, or copy the vertices of one"
            )
        _require_no_copies(rows)
        isolated = np.bincount(rows.ravel(), minlength=len(points)) == 0
        if isolated.any():
            raise MeshError(f"vertex {int(np.argmax(isolated))} belongs to no triangle: remove it")
        super().__init__(points, pairs.astype(np.int32), np.zeros((0, 4), dtype=np.int32))
        both = np.concatenate([rows, rows[:, ::-1]])
        self.__dict__.update(triangles=read_only(rows), surface=read_only(both), areas=read_only(areas))

    @classmethod
    def from_surface(
        cls, source: Any, *, up: Up | None = None, center: bool = False, scale: float = 1.0
    ) -> ShellMesh:
        """Make a shell from a triangle mesh, such as a garment in an artist's file.

        All meshes of the source become one shell. Vertices at the same position are merged, because files
        have copies of vertices at seams of textures. Triangles without area and copies of triangles are
        dropped.
        Args:
            source: path of a .glb, .gltf, .obj, .ply, .stl or .off file, a trimesh.Trimesh or Scene, or
                (vertices (n, 3) [m], triangles (m, 3)).
            up: axis that points up in the file, "y" or "z"; None: the usual axis of the file type.
            center: True moves the centre of the bounding box to the origin.
            scale: length of the file's unit [m].
        Raises: MeshError for a source that cannot be read, and as for `ShellMesh`.
        """
        surfaces = read_surfaces(source, up, center=center, scale=scale)
        vertices, triangles = welded(*joined(surfaces))
        if not len(triangles):
            raise MeshError("no triangle of the surface has an area: check the file, and the scale")
        return cls(vertices, triangles)

    def __repr__(self) -> str:
        return f"ShellMesh({len(self.vertices)} vertices, {len(self.triangles)} triangles)"

    def __reduce__(self) -> tuple[Any, ...]:
        # Copying and unpickling rebuild the mesh, so that its arrays are read-only again.
        return (ShellMesh, (self.vertices, self.triangles))

    def _with_vertices(self, vertices: FloatArray) -> ShellMesh:
        return ShellMesh(vertices, self.triangles)


def half_edges(triangles: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return the ends of the edges of triangles, in ascending order, (3 m, 2).

    Row 3 t + k is the edge of triangle t opposite to its corner k.
    """
    ends = np.stack([triangles[:, [1, 2]], triangles[:, [2, 0]], triangles[:, [0, 1]]], axis=1)
    return np.sort(ends.reshape(-1, 2), axis=1)


def edges_of_triangles(mesh: ShellMesh) -> NDArray[np.int64]:
    """Return the row in `mesh.edges` of each half edge, (3 m,). See `half_edges`."""
    count = len(mesh.vertices)
    keys = half_edges(mesh.triangles).astype(np.int64) @ [count, 1]
    return np.searchsorted(mesh.edges.astype(np.int64) @ [count, 1], keys)


def _checked_areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the areas of triangles, (m,) [m^2]. Raises: MeshError for a triangle without area."""
    a, b, c = points[triangles].swapaxes(0, 1)
    sides = np.stack([b - a, c - b, a - c])
    longest = np.sqrt((sides**2).sum(axis=2)).max(axis=0)
    doubled = np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1))
    bad = doubled <= FLATTEST * longest**2
    if bad.any():
        row = int(np.argmax(bad))
        raise MeshError(
            f"triangle {row} has no area (vertices {name_vertices(triangles[row])}): remove it or move a "
            "vertex"
        )
    return np.asarray(doubled / 2.0)


def _require_no_copies(triangles: IntArray) -> None:
    rows = np.sort(triangles, axis=1)
    order = np.lexsort(rows.T)
    same = (rows[order][1:] == rows[order][:-1]).all(axis=1)
    if same.any():
        first, second = sorted(order[int(np.argmax(same)) :][:2].tolist())
        raise MeshError(
            f"triangles {first} and {second} have the same vertices ({name_vertices(triangles[first])}): "
            "remove one. A shell has both sides without copies"
        )


def sheet(size: ArrayLike, cells: tuple[int, int]) -> ShellMesh:
    """Make a flat rectangle in the x-y plane, centred at the origin.

    Vertex i * (cells[1] + 1) + j lies at column i and row j. Vertex 0 is the corner at the lowest x and y.
    All diagonals of cells have the same direction, because bending is then exact in every direction.
    Args:
        size: (2,) lengths along x and y [m].
        cells: number of cells along x and y. Each cell has two triangles.
    Raises: OptionError for a number out of range.
    Example:
        tablecloth = sheet((1.2, 1.2), (24, 24))
    """
    width, height = (as_positive(value, "size", "m") for value in as_array(size, "size", (2,), "m"))
    nx, ny = as_cells(cells)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1), indexing="ij"))
    vertices = np.stack([(i - nx / 2) * (width / nx), (j - ny / 2) * (height / ny), 0.0 * i], axis=1)
    a = np.flatnonzero((i < nx) & (j < ny))
    b, c, d = a + ny + 1, a + ny + 2, a + 1
    return ShellMesh(vertices, np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3))
