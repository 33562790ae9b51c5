"""Compute the signed distance of a closed mesh on a grid around it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.contact.distances.mesh import MARGIN
from taichi_soft.contact.kernels.distance_grid import STEPS, accumulate_crossings, compute_grid_distances
from taichi_soft.contact.shapes.closed_mesh import ClosedMesh
from taichi_soft.contact.shapes.shape import as_length
from taichi_soft.contact.shapes.triangle_tree import triangle_tree
from taichi_soft.core.errors import MeshError
from taichi_soft.core.runtime import init
from taichi_soft.meshing.advice import with_install_hint

DEFAULT_CELL_COUNT = 64
"""Default number of cells along the longest side of the mesh."""

MAX_NODES = 2_000_000
"""Largest number of nodes of a grid. Such a grid takes 8 MB and is computed in a few seconds."""

MAX_LOST = 0.1
"""Largest fraction of the surface that can have no solid behind it on the grid. The limit is not 0, because
every grid loses the outer cells of sharp edges."""

DEPTHS = (0.5, 1.0)
"""Depths below the surface, in cells. The grid must be solid at one of these depths at least."""

SHALLOWEST = 0.05
"""Smallest interpolated depth, in cells, at which a sample counts as solid."""

# Barycentric coordinates of ten points spread evenly over a triangle.
SHARES: NDArray[np.float64] = (
    np.array([[i + 1 / 3, j + 1 / 3, 10 / 3 - i - j] for i in range(4) for j in range(4 - i)]) / 4
)


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid with equal spacing along all axes."""

    origin: NDArray[np.float64]  # position of the first node, (3,) [m]
    cell: float  # distance between neighbouring nodes [m]
    resolution: tuple[int, int, int]  # number of nodes along each axis


def grid_around(mesh: ClosedMesh, cell: Any) -> Grid:
    """Return the grid for a mesh. Neighbouring nodes are `cell` [m] apart; None uses the default.

    Raises: OptionError for a bad cell, MeshError for too many nodes.
    """
    low, high = mesh.bounds
    longest = float((high - low).max())
    size = longest / DEFAULT_CELL_COUNT if cell is None else as_length(cell, "cell")
    counts = _node_counts(high - low, size)
    if counts.prod() > MAX_NODES:
        larger = size
        while _node_counts(high - low, larger).prod() > MAX_NODES:
            larger *= 1.02
        raise MeshError(
            f"cell={size:g} m makes {counts.prod():,.0f} nodes over {longest:g} m, more than {MAX_NODES:,}: "
            f"use cell={1.01 * larger:.3g} or cut the mesh into several shapes"
        )
    x, y, z = (int(count) for count in counts)
    return Grid((low + high) / 2 - size * (counts - 1) / 2, size, (x, y, z))


def _node_counts(size: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    # A rounding error must not add a cell to a side that is a whole number of cells long.
    counts: NDArray[np.float64] = np.ceil(np.round(size / cell, 6)) + 1 + 2 * MARGIN
    return counts


def distance_grid(mesh: ClosedMesh, grid: Grid) -> NDArray[np.float32]:
    """Compute the signed distance of each node from the mesh, negative inside, (nx, ny, nz) [m].

    A node is inside if the surface winds around it once or more. Taichi is started if necessary.
    Raises: MeshError if a part of the mesh is inside out, or if walls are too thin for the grid.
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
            f"a part of the mesh is inside out, around {_place(windings, grid)} m: turn it by "
            f"{with_install_hint('mesh.fix_normals()', 'networkx', 'scipy')}"
        )
    _require_thickness(corners, distances, grid)
    metres: NDArray[np.float32] = distances * np.float32(grid.cell)
    return metres


def _place(windings: NDArray[np.int32], grid: Grid) -> list[float]:
    node = np.array(np.unravel_index(int(windings.argmin()), windings.shape))
    place: list[float] = np.round(grid.origin + node * grid.cell, 6).tolist()
    return place


def _require_thickness(corners: NDArray[np.float64], distances: NDArray[np.float32], grid: Grid) -> None:
    """Raise a MeshError if more than the fraction `MAX_LOST` of the surface has no solid behind it.

    Args: corners: corners of the triangles, (f, 3, 3), in cells. distances: distances of the nodes, in cells.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    corners, normals, areas = corners[areas > 0], normals[areas > 0], areas[areas > 0]
    inwards = -normals / areas[:, None]
    lost = np.ones((len(corners), len(SHARES)), dtype=bool)
    for column, shares in enumerate(SHARES):
        places = shares @ corners
        for depth in DEPTHS:
            lost[:, column] &= _interpolated(distances, places + depth * inwards) > -SHALLOWEST
    share = float((lost.mean(axis=1) * areas).sum() / areas.sum())
    if share > MAX_LOST:
        worst = corners[lost.mean(axis=1).argmax()].mean(axis=0)
        place = (grid.origin + grid.cell * worst).round(6).tolist()
        raise MeshError(
            f"{share:.0%} of the mesh is too thin for cell={grid.cell:.3g} m, such as at {place} m: pass a "
            f"smaller one, such as cell={grid.cell / 2:.3g} (a wall needs 2 cells), or make it thicker"
        )


def _interpolated(distances: NDArray[np.float32], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Interpolate `distances` trilinearly at `places`, (n, 3) [cells]. Returns: distances, (n,) [cells]."""
    base = np.floor(places).astype(np.int64)
    value = np.zeros(len(places))
    for corner in product((0, 1), repeat=3):
        shares = np.where(corner, places - base, base + 1 - places).prod(axis=1)
        value += shares * distances[tuple((base + corner).T)]
    return value
