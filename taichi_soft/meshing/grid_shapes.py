"""Shapes made of box-shaped cells. A cell has five tetrahedra: one in the middle and four at corners."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import as_count, as_positive, to_array
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing.arrays import MAX_TETS, FloatArray, require_tet_count
from taichi_soft.meshing.tet_mesh import TetMesh

# Corner i of a cell has the bits of i as coordinates: x = bit 0, y = bit 1, z = bit 2.
CORNERS: NDArray[np.int64] = np.array([(i & 1, i >> 1 & 1, i >> 2) for i in range(8)])
# The two divisions of a cell are mirror images. Neighbouring cells use different divisions, so that the
# diagonals of common faces match.
EVEN_CELL: NDArray[np.int64] = np.array(
    [(0, 3, 5, 6), (1, 0, 3, 5), (2, 0, 6, 3), (4, 0, 5, 6), (7, 3, 6, 5)]
)
ODD_CELL: NDArray[np.int64] = EVEN_CELL ^ 1


def box(
    size: tuple[float, float, float] = (1.0, 1.0, 1.0), cells: tuple[int, int, int] = (4, 4, 4)
) -> TetMesh:
    """Make a box centred at the origin.

    Args:
        size: edge lengths along x, y and z [m].
        cells: number of cells along x, y and z. A cell has five tetrahedra. The smallest dihedral angle is
            54.7 degrees with cubic cells.
    Raises: OptionError for sizes that are not positive or counts below 1.
    Example:
        brick = box((0.4, 0.2, 0.1), cells=(8, 4, 2))
        print(len(brick.tets), brick.volume)
    """
    lengths = _lengths("size", size)
    counts = [as_count(value, f"cells[{axis}]") for axis, value in enumerate(_three("cells", cells))]
    require_tet_count(5 * math.prod(counts))
    return voxels(np.ones(counts, dtype=bool), tuple(lengths / counts))


def beam(length: float = 4.0, width: float = 1.0, height: float = 1.0, cells_across: int = 2) -> TetMesh:
    """Make a bar along x, centred at the origin, whose cells are as close to cubes as possible.

    Args:
        length, width, height: edge lengths along x, y and z [m].
        cells_across: number of cells along the shortest edge. The smallest dihedral angle is 54.7 degrees
            if the cells are cubic and at least 32 otherwise.
    Raises: OptionError for sizes that are not positive or a count below 1.
    """
    size = (
        as_positive(length, "length", "m"),
        as_positive(width, "width", "m"),
        as_positive(height, "height", "m"),
    )
    cell = min(size) / as_count(cells_across, "cells_across")
    nx, ny, nz = (max(1, round(min(edge / cell, MAX_TETS))) for edge in size)
    return box(size, (nx, ny, nz))


def voxels(mask: ArrayLike, spacing: float | tuple[float, ...] = 1.0) -> TetMesh:
    """Make a body with one cell for every True entry of a grid, such as a frame, a letter or a scanned shape.

    Args:
        mask: bool (nx, ny, nz), True for filled cells. The bounding box of the filled cells is centred at
            the origin.
        spacing: edge of a cell [m], one number or three (x, y, z). The smallest dihedral angle is 54.7
            degrees with cubic cells.
    Raises: MeshError for a mask of another shape or type, or without a filled cell; OptionError for a spacing
        that is not positive.
    """
    filled = to_array(mask, "mask")
    if filled.dtype != np.bool_ or filled.ndim != 3:
        raise MeshError(f"mask has shape {filled.shape}, dtype {filled.dtype}: pass bool (nx, ny, nz)")
    steps = spacing if hasattr(spacing, "__len__") else (spacing,) * 3
    edges = _lengths("spacing", steps)
    cells = np.argwhere(filled)
    if len(cells) == 0:
        raise MeshError(f"mask of shape {filled.shape} has no filled cell: set at least one to True")
    cells -= cells.min(axis=0)

    corners = cells[:, None, :] + CORNERS
    shape = corners.max(axis=(0, 1)) + 1
    keys = np.ravel_multi_index(tuple(corners.reshape(-1, 3).T), tuple(shape))
    used, inverse = np.unique(keys, return_inverse=True)
    grid = np.stack(np.unravel_index(used, tuple(shape)), axis=1)
    vertices = (grid - (shape - 1) / 2.0) * edges

    odd = cells.sum(axis=1) % 2 == 1
    local = np.where(odd[:, None, None], ODD_CELL, EVEN_CELL).reshape(len(cells), -1)
    tets = np.take_along_axis(inverse.reshape(len(cells), 8), local, axis=1).reshape(-1, 4)
    return TetMesh(vertices, tets, fix_orientation=True)


def _lengths(name: str, values: object) -> FloatArray:
    return np.array([as_positive(v, f"{name}[{axis}]", "m") for axis, v in enumerate(_three(name, values))])


def _three(name: str, values: object) -> tuple[float, ...]:
    array = np.asarray(values, dtype=object)
    if array.shape != (3,):
        raise OptionError(f"{name} is {values!r}: pass three numbers (x, y, z)")
    return tuple(array)
