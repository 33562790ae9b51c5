"""Sharp edges: where a surface bends too far to be shaded as if it were round."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SHARPEST_ROUND = math.cos(math.radians(60.0))
"""Cosine of the largest angle between neighbouring triangles that counts as round: above that of a sphere of
twenty triangles (42 degrees), below that of a box (90)."""


def split_at_creases(
    positions: NDArray[np.float64], triangles: NDArray[np.integer]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Give each vertex on a sharp edge a copy per side, so that each side has a normal of its own.

    Args:
        positions: (n, 3) [m].
        triangles: (m, 3) vertex indices.
    Returns: the vertex that each of the k copies stands for, ascending, int64 (k,), without vertices of no
        triangle; and the triangles in terms of copies, int32 (m, 3).
    """
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-300)[:, None]

    corner = np.arange(triangles.size).reshape(-1, 3)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    vertex = triangles.ravel().astype(np.int64)
    forward = vertex[start] * len(positions) + vertex[end]
    backward = vertex[end] * len(positions) + vertex[start]
    order = np.argsort(forward, kind="stable")
    place = np.minimum(np.searchsorted(forward[order], backward), len(order) - 1)
    twin = order[place]  # the same edge, seen from the neighbour
    here, there = start // 3, twin // 3
    bend = np.einsum("ij,ij->i", normals[here], normals[there])
    flat = (lengths[here] == 0.0) | (lengths[there] == 0.0)  # a triangle without area bends nothing
    smooth = (forward[twin] == backward) & ((bend >= SHARPEST_ROUND) | flat)

    # Corners that meet across a smooth edge are one: spread the smallest number of each group.
    first, second = start[smooth], end[twin[smooth]]
    group = np.arange(triangles.size)
    while True:
        spread = group.copy()
        np.minimum.at(spread, first, group[second])
        np.minimum.at(spread, second, group[first])
        spread = spread[spread]
        if np.array_equal(spread, group):
            break
        group = spread
    keys, copies = np.unique(vertex * triangles.size + group, return_inverse=True)
    return keys // triangles.size, np.ascontiguousarray(copies.reshape(-1, 3), dtype=np.int32)
