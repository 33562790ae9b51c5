"""The signed distance of a closed mesh on a grid round it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.collision.mesh import MARGIN
from taichi_soft.errors import MeshError
from taichi_soft.kernels.distance_grid import STEPS, accumulate_crossings, compute_grid_distances
from taichi_soft.runtime import init
from taichi_soft.shapes.closed_mesh import ClosedMesh
from taichi_soft.shapes.shape import as_length
from taichi_soft.shapes.triangle_tree import triangle_tree

USUAL_CELLS = 64
"""Along the longest side of the mesh, where nobody says."""

MOST_NODES = 2_000_000
"""Of a grid: 8 MB, and some seconds to fill."""

DEEP = 0.1
"""Cells inside the solid, from where on a node stands for it in the grid."""

MOST_LOST = 0.1
"""Share of the surface that may have no such node near it. Sharp edges lose their outer cells on any grid."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Nodes at equal distances along all axes."""

    origin: NDArray[np.float64]  # of the first node (3,) [m]
    cell: float  # [m]
    resolution: tuple[int, int, int]  # nodes


def grid_round(mesh: ClosedMesh, cell: Any) -> Grid:
    """The grid of a mesh; None takes the usual cell. Raises: OptionError, MeshError for too many nodes."""
    low, high = mesh.bounds
    longest = float((high - low).max())
    size = longest / USUAL_CELLS if cell is None else as_length(cell, "cell")
    counts = np.ceil(np.round((high - low) / size, 6)) + 1 + 2 * MARGIN
    if counts.prod() > MOST_NODES:
        finest = size * (counts.prod() / MOST_NODES) ** (1 / 3)
        raise MeshError(
            f"cell={size:g} m makes {counts.prod():,.0f} nodes over {longest:g} m, more than {MOST_NODES:,}: "
            f"take cell={finest * 1.05:.3g} or cut the mesh into several shapes"
        )
    x, y, z = (int(count) for count in counts)
    return Grid((low + high) / 2 - size * (counts - 1) / 2, size, (x, y, z))


def distance_grid(mesh: ClosedMesh, grid: Grid) -> NDArray[np.float32]:
    """Distances of the nodes, negative inside, (nx, ny, nz) [m]. Starts Taichi if nobody has.

    Inside is what the surface winds round, once or more.
    Raises: MeshError for a part that is inside out, or for walls too thin for the grid.
    """
    init()
    corners = ((mesh.vertices - grid.origin) / grid.cell)[mesh.triangles]
    lattice = np.ascontiguousarray(np.rint(corners[:, :, :2] * STEPS), dtype=np.int64)
    heights = np.ascontiguousarray(corners[:, :, 2])
    windings = np.zeros(grid.resolution, dtype=np.int32)
    accumulate_crossings(lattice, heights, windings)
    ordered, boxes = triangle_tree(corners.astype(np.float32))
    distances = np.empty(grid.resolution, dtype=np.float32)
    compute_grid_distances(ordered, boxes, windings, distances)
    if windings.min() < 0:
        raise MeshError(
            f"a part of the mesh is inside out, round {_place(windings, grid)} m: turn it by "
            "mesh.fix_normals()"
        )
    _require_thickness(corners, distances, grid)
    metres: NDArray[np.float32] = distances * np.float32(grid.cell)
    return metres


def _place(windings: NDArray[np.int32], grid: Grid) -> list[float]:
    node = np.array(np.unravel_index(int(windings.argmin()), windings.shape))
    place: list[float] = np.round(grid.origin + node * grid.cell, 6).tolist()
    return place


def _require_thickness(corners: NDArray[np.float64], distances: NDArray[np.float32], grid: Grid) -> None:
    """Raises: MeshError where too much of the surface has no inside on the grid."""
    deep = distances < -DEEP
    base = np.floor(corners.mean(axis=1)).astype(np.int64) - (MARGIN - 1)
    held = np.zeros(len(base), dtype=bool)
    for step in product(range(2 * MARGIN), repeat=3):
        held |= deep[tuple((base + step).T)]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    lost = float(areas[~held].sum() / areas.sum())
    if lost > MOST_LOST:
        place = (grid.origin + grid.cell * corners.mean(axis=1)[(~held).argmax()]).round(6).tolist()
        raise MeshError(
            f"{lost:.0%} of the mesh is too thin for cell={grid.cell:.3g} m, such as at {place} m: pass a "
            f"smaller one, such as cell={grid.cell / 2:.3g} (a wall needs 2 cells), or make it thicker"
        )
