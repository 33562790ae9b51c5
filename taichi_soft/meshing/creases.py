"""Sharp edges of a surface. Across these edges, the shading of the surface is not smooth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

DEFAULT_CREASE = 60.0
"""By default, two neighbouring triangles are shaded smoothly if the angle between their normals is at most
this value [degrees]. An icosahedron (42 degrees) looks round, and a box (90 degrees) keeps its edges."""

_COSINE_TOLERANCE = 1e-9
"""Tolerance for comparing the cosine of an angle with the cosine of the crease angle. Without it, rounding
could split triangles that meet at exactly the crease angle."""


def split_at_creases(
    positions: NDArray[np.float64], triangles: NDArray[np.integer], crease: float | None
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Duplicate each vertex on a sharp edge, so that each side of the edge has its own normal.

    Triangles that share a vertex but no edge get separate copies of the vertex too. The two sides of a sheet
    that contains each triangle twice also get separate copies.
    Args:
        positions: (n, 3) [m].
        triangles: (m, 3) vertex indices.
        crease: angle between neighbouring triangles above which their edge is sharp, 0 to 180 [degrees]; None
            if no edge is sharp.
    Returns: the original vertex of each of the k copies, ascending, int64 (k,); and the triangles with copies
        as corners, int32 (m, 3). Unused vertices have no copies.
    """
    corner = np.arange(triangles.size).reshape(-1, 3)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    vertex = triangles.ravel().astype(np.int64)
    min_cosine = -1.0 if crease is None else math.cos(math.radians(crease))
    opposite, bend = _neighbours(positions, triangles, vertex[start], vertex[end])
    smooth = bend >= min_cosine - _COSINE_TOLERANCE

    # Corners that meet across a smooth edge become one vertex. Propagate the smallest number of each group.
    first, second = start[smooth], end[opposite[smooth]]
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


def _neighbours(
    positions: NDArray[np.float64],
    triangles: NDArray[np.integer],
    start: NDArray[np.int64],
    end: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Find the neighbour across each side of each triangle.

    Sides are numbered by the corner at which they begin. If a side has several neighbours, the neighbour with
    the smallest bend is used. A triangle without area counts as coplanar with its neighbours.
    Returns: the same side in the neighbouring triangle, (3 m,), and the cosine of the angle between the two
        triangles, (3 m,), -2 without a neighbour.
    """
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-300)[:, None]
    sorted_vertices = np.sort(triangles, axis=1)

    forward, backward = start * len(positions) + end, end * len(positions) + start
    order = np.argsort(forward, kind="stable")
    begin = np.searchsorted(forward[order], backward, side="left")
    count = np.searchsorted(forward[order], backward, side="right") - begin
    opposite, best = np.zeros(len(start), dtype=np.int64), np.full(len(start), -2.0)
    for number in range(int(count.max(initial=0))):
        side = np.flatnonzero(count > number)
        other = order[begin[side] + number]
        here, there = side // 3, other // 3
        bend = np.einsum("ij,ij->i", normals[here], normals[there])
        bend[(lengths[here] == 0.0) | (lengths[there] == 0.0)] = 1.0
        bend[(sorted_vertices[here] == sorted_vertices[there]).all(axis=1)] = -2.0  # the back of a sheet
        is_better = bend > best[side]
        opposite[side[is_better]], best[side[is_better]] = other[is_better], bend[is_better]
    return opposite, best
