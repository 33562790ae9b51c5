"""Corners of triangles at the same place as one vertex: files have copies where texture or normals jump."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

WELD = 1e-7
"""Of the longest side: vertices that are nearer count as one. float32 files round by as much."""


def places_of(vertices: FloatArray, size: float) -> Ints:
    """A number for each vertex, (n,), alike for those at the same place.

    Args: size: longest side of the box round those in use [m].
    """
    places = np.round(vertices / (WELD * size if size > 0.0 else 1.0)) + 0.0  # -0.0 is 0.0
    return np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)


def welded(vertices: FloatArray, triangles: Ints) -> tuple[FloatArray, Ints]:
    """Vertices in use (k, 3), one for each place, and triangles between three of them (j, 3), each once."""
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
    number = np.full(len(used), -1)
    number[kept] = np.arange(len(kept))
    return points[first[kept]], number[corners].astype(np.int64)
