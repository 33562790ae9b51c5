"""A block of tetrahedra of many shapes and orientations. Such a mesh favours no law."""

from __future__ import annotations

import numpy as np

from taichi_soft import TetMesh

JITTER = 0.12
"""Largest random displacement of a vertex [cell edge]."""
FLAT = 1e-6
"""Smallest volume of a tetrahedron, as a fraction of the volume of a cell. Flatter tetrahedra are removed,
because their corners lie in one face of the block."""


def irregular_block(length: float, width: float, cells: int) -> TetMesh:
    """Make a block of square section about the origin, with its axis along x. The result is deterministic.

    The vertices form a body-centred lattice, are moved at random within the block's faces and edges, and are
    connected by Delaunay's rule. Corners, edges and faces of the block stay exact.
    Args:
        length, width: edge along x, and edges along y and z [m]; `length` should be an integer number of
            cells.
        cells: number of cells across the width.
    """
    from scipy.spatial import Delaunay

    cell = width / cells
    half = np.array([length, width, width]) / 2
    counts = (round(length / cell), cells, cells)
    axes = [np.linspace(-h, h, count + 1) for h, count in zip(half, counts, strict=True)]
    corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    middles = [(axis[1:] + axis[:-1]) / 2 for axis in axes]
    centres = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 3)
    points = np.concatenate([corners, centres])
    inside = half - np.abs(points) > 1e-9 * cell
    moves = np.random.default_rng(0).uniform(-JITTER, JITTER, points.shape)
    points += np.where(inside, cell * moves, 0.0)
    tets = Delaunay(points).simplices.astype(np.int64)
    arms = points[tets[:, 1:]] - points[tets[:, :1]]
    solid = np.abs(np.linalg.det(arms)) / 6 > FLAT * cell**3
    return TetMesh(points, tets[solid], fix_orientation=True)
