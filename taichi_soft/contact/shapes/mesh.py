"""The shape of the solid inside a closed triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.shape_kind import ShapeKind
from taichi_soft.contact.shapes.closed_mesh import ClosedMesh, closed_mesh
from taichi_soft.contact.shapes.distance_grid import Grid, distance_grid, grid_around
from taichi_soft.contact.shapes.grid_cache import grid_key, read_grid, write_grid
from taichi_soft.contact.shapes.shape import SEAM, Shape, Triangles
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, IntArray, read_only


def _rebuild(vertices: FloatArray, triangles: IntArray, cell: float) -> MeshShape:
    return MeshShape((vertices, triangles), cell=cell)


@serialised("vertices", "triangles", "cell", make=_rebuild)
@dataclass(frozen=True, eq=False, init=False)
class MeshShape(Shape):
    """The solid inside a closed mesh, stored as its signed distance on a grid.

    Distances are accurate to a fraction of a cell, and edges are rounded by the same amount. Parts thinner
    than two cells can be lost. A mesh that would lose more than a tenth of its surface raises a MeshError.
    Args:
        mesh: a trimesh.Trimesh, a TetMesh (its surface at rest) or (vertices (n, 3) [m], triangles (m, 3)),
            counterclockwise seen from outside. Parts of the mesh can overlap.
        cell: spacing of the grid [m]. The grid can have up to 2,000,000 nodes. None uses a 64th of the
            longest side.
        cache: True stores the grid on disk for the next start, in $TAICHI_SOFT_CACHE or the user's cache
            folder.
    Raises: MeshError for a mesh that is open, inside out, flat, not finite or too thin for the cell, with a
    suggested fix; OptionError for a cell out of range.

    Computing a grid starts Taichi if necessary, and takes from 0.1 s to a few seconds.
    """

    kind = ShapeKind.MESH
    seam = SEAM
    vertices: FloatArray
    triangles: IntArray
    cell: float
    _grid: Grid
    _samples: NDArray[np.float32]

    def __init__(self, mesh: Any, *, cell: float | None = None, cache: bool = True) -> None:
        if not isinstance(cache, bool):
            raise OptionError(f"cache must be True or False, got {cache!r}")
        closed = closed_mesh(mesh)
        grid = grid_around(closed, cell)
        distances = _cached_distances(closed, grid) if cache else distance_grid(closed, grid)
        # use __dict__, because the class is frozen
        self.__dict__.update(
            vertices=read_only(closed.vertices),
            triangles=read_only(closed.triangles),
            cell=grid.cell,
            _grid=grid,
            _samples=read_only(distances.reshape(-1)),
        )

    def __repr__(self) -> str:
        x, y, z = self.resolution
        return f"MeshShape({len(self.triangles)} triangles, {x} x {y} x {z} nodes, cell={self.cell:.6g})"

    def _values(self) -> tuple[float, ...]:
        x, y, z = self._grid.origin
        return (x, y, z, self.cell)

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Number of nodes of the grid along each axis."""
        return self._grid.resolution

    @property
    def samples(self) -> NDArray[np.float32]:
        """Signed distance of each node [m], last axis fastest, float32 (k,)."""
        return self._samples

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the mesh's bounding box, (2, 3) [m]."""
        corners: NDArray[np.float64] = read_only(ClosedMesh(self.vertices, self.triangles).bounds)
        return corners

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of points below the surface, interpolated on the grid, (n,) [m], negative outside.

        Args:
            points: points in the frame of the shape, (n, 3) [m].
        """
        resolution = np.array(self.resolution)
        distances = self._samples.reshape(self.resolution)
        u = (points - self._grid.origin) / self.cell
        base = np.clip(np.floor(u).astype(np.int64), 0, resolution - 2)
        w = u - base
        depths = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            share = np.where(corner, w, 1.0 - w).prod(axis=1)
            depths -= share * distances[tuple((base + corner).T)]
        outside = (u < 0.0).any(axis=1) | (u > resolution - 1).any(axis=1)
        return np.where(outside, -np.inf, depths)

    def surface(self) -> Triangles:
        """Return the original mesh, which the grid approximates to a fraction of a cell."""
        return self.vertices, self.triangles


def _cached_distances(mesh: ClosedMesh, grid: Grid) -> NDArray[np.float32]:
    key = grid_key(mesh, grid)
    distances = read_grid(key, grid)
    if distances is None:
        distances = distance_grid(mesh, grid)
        write_grid(key, distances)
    return distances
