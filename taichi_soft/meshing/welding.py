"""Merge vertices at the same position. Files contain copies of vertices at seams of textures or normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

WELD = 1e-7
"""Distance below which vertices are merged, as a fraction of the longest side of their bounding box. Files in
float32 have rounding errors of this size."""


def places_of(vertices: FloatArray, size: float) -> Ints:
    """Number the positions of vertices, (n,). Vertices at the same position get the same number.

    Args: size: longest side of the bounding box of the vertices in use [m].
    """
    positions = np.round(vertices / (WELD * size if size > 0.0 else 1.0)) + 0.0  # turns -0.0 into 0.0
    return np.unique(positions, axis=0, return_inverse=True)[1].reshape(-1)


def welded(vertices: FloatArray, triangles: Ints) -> tuple[FloatArray, Ints]:
    """Merge vertices at the same position, and drop unused vertices, degenerate and duplicate triangles.

    Returns: vertices (k, 3), triangles (j, 3).
    """
    size = float(np.ptp(vertices[np.unique(triangles)], axis=0).max())
    corners = places_of(vertices, size)[triangles]
    corners, points = corners.reshape(-1), vertices[triangles.reshape(-1)]
    used, first, corners = np.unique(corners, return_index=True, return_inverse=True)
    corners = corners.reshape(-1, 3)
    in_order = np.sort(corners, axis=1)
    is_new = np.zeros(len(corners), dtype=np.bool_)
    is_new[np.unique(in_order, axis=0, return_index=True)[1]] = True
    corners = corners[is_new & (np.diff(in_order, axis=1) > 0).all(axis=1)]
    kept = np.unique(corners)
    new_index = np.full(len(used), -1)
    new_index[kept] = np.arange(len(kept))
    return points[first[kept]], new_index[corners].astype(np.int64)
