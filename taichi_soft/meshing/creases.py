"""Sharp edges: where a surface bends too far to be shaded as if it were round."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

ROUND = 60.0
"""Largest angle between neighbouring triangles that counts as round [degrees], where nobody says otherwise:
above that of a sphere of twenty triangles (42), below that of a box (90)."""

_SLACK = 1e-9
"""Of cosines: two triangles of one plane are round at 0 degrees too, and those that bend by the limit."""


def split_at_creases(
    positions: NDArray[np.float64], triangles: NDArray[np.integer], crease: float | None
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Give each vertex on a sharp edge a copy per side, so that each side has a normal of its own.

    Triangles that meet in a vertex but in no edge have copies of their own too, and so have the two sides of
    a sheet that has each triangle twice.
    Args:
        positions: (n, 3) [m].
        triangles: (m, 3) vertex indices.
        crease: angle between neighbouring triangles beyond which their edge is sharp, 0 to 180 [degrees];
            None: no edge is.
    Returns: the vertex that each of the k copies stands for, ascending, int64 (k,), without vertices of no
        triangle; and the triangles in terms of copies, int32 (m, 3).
    """
    corner = np.arange(triangles.size).reshape(-1, 3)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    vertex = triangles.ravel().astype(np.int64)
    sharpest_round = -1.0 if crease is None else math.cos(math.radians(crease))
    twin, bend = _neighbours(positions, triangles, vertex[start], vertex[end])
    smooth = bend >= sharpest_round - _SLACK

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


def _neighbours(
    positions: NDArray[np.float64],
    triangles: NDArray[np.integer],
    start: NDArray[np.int64],
    end: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Across each side of each triangle: the same edge as its neighbour has it, and the cosine of the bend.

    Sides are numbered by the corner where they begin. Of several neighbours it is the one that bends least;
    the cosine is -2 where there is none. A triangle without area bends nothing.
    """
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(lengths, 1e-300)[:, None]
    names = np.sort(triangles, axis=1)

    forward, backward = start * len(positions) + end, end * len(positions) + start
    order = np.argsort(forward, kind="stable")
    begin = np.searchsorted(forward[order], backward, side="left")
    count = np.searchsorted(forward[order], backward, side="right") - begin
    twin, best = np.zeros(len(start), dtype=np.int64), np.full(len(start), -2.0)
    for number in range(int(count.max(initial=0))):
        side = np.flatnonzero(count > number)
        other = order[begin[side] + number]
        here, there = side // 3, other // 3
        bend = np.einsum("ij,ij->i", normals[here], normals[there])
        bend[(lengths[here] == 0.0) | (lengths[there] == 0.0)] = 1.0
        bend[(names[here] == names[there]).all(axis=1)] = -2.0  # the back of a sheet
        is_better = bend > best[side]
        twin[side[is_better]], best[side[is_better]] = other[is_better], bend[is_better]
    return twin, best
