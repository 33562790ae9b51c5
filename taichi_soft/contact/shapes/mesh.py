"""A solid inside a closed triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.kinds import ShapeKind
from taichi_soft.contact.shapes.closed_mesh import ClosedMesh, closed_mesh
from taichi_soft.contact.shapes.distance_grid import Grid, distance_grid, grid_round
from taichi_soft.contact.shapes.grid_cache import grid_key, read_grid, write_grid
from taichi_soft.contact.shapes.shape import SEAM, Shape, Triangles
from taichi_soft.core.errors import OptionError
from taichi_soft.core.serialisation import serialised
from taichi_soft.meshing.arrays import FloatArray, IntArray, read_only


def _again(vertices: FloatArray, triangles: IntArray, cell: float) -> MeshShape:
    return MeshShape((vertices, triangles), cell=cell)


@serialised("vertices", "triangles", "cell", make=_again)
@dataclass(frozen=True, eq=False, init=False)
class MeshShape(Shape):
    """The solid inside a closed mesh, as its signed distance on a grid tells it.

    Distances are right to a fraction of a cell; edges are rounded off by as much, and what is thinner than
    two cells may be lost: a mesh that would lose a tenth of its surface is refused.
    Args:
        mesh: a trimesh.Trimesh, a TetMesh (its surface at rest) or (vertices (n, 3) [m], triangles (m, 3)),
            counterclockwise seen from outside. Parts may overlap.
        cell: of the grid [m], of which at most 2,000,000 nodes fit; None takes a 64th of the longest side.
        cache: keep the grid on disk, in $TAICHI_SOFT_CACHE or the user's cache folder, for the next time.
    Raises: MeshError for a mesh that is open, inside out, flat, not finite or too thin for the cell, with the
        way out; OptionError for a cell out of range.

    Computing a grid takes Taichi, which is started if nobody has, and a tenth of a second to some seconds.
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
        grid = grid_round(closed, cell)
        distances = _kept_distances(closed, grid) if cache else distance_grid(closed, grid)
        # Through __dict__, past the lock of a frozen class.
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
        """Nodes of the grid along each axis."""
        return self._grid.resolution

    @property
    def samples(self) -> NDArray[np.float32]:
        """Signed distance of each node [m], the last axis running fastest, float32 (k,)."""
        return self._samples

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper corner of the mesh, (2, 3) [m]."""
        corners: NDArray[np.float64] = read_only(ClosedMesh(self.vertices, self.triangles).bounds)
        return corners

    def depths(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How deep points (n, 3) in its frame lie inside, (n,) [m], below 0 outside; from its grid.

        Args:
            points: in the frame of the shape, (n, 3) [m].
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
        """The mesh itself, which the grid follows to a fraction of a cell."""
        return self.vertices, self.triangles


def _kept_distances(mesh: ClosedMesh, grid: Grid) -> NDArray[np.float32]:
    key = grid_key(mesh, grid)
    distances = read_grid(key, grid)
    if distances is None:
        distances = distance_grid(mesh, grid)
        write_grid(key, distances)
    return distances
