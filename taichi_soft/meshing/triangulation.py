"""Triangulation of polygons with three or more corners in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

FOLDED = 1e-9
"""A triangle of opposite orientation counts as flat if its area is below this fraction of the polygon's
area."""


def triangulated(corners: FloatArray, counts: Ints) -> tuple[Ints, Ints]:
    """Triangulate polygons by fans. Polygons that do not contain their fan are triangulated by ear clipping.

    Args:
        corners: corners of all polygons in sequence, (k, 3).
        counts: number of corners of each polygon, (f,). Polygons with fewer than three corners are skipped.
    Returns: triangles as rows of `corners`, (m, 3), in the order and orientation of the polygons; and the
        polygon of each triangle, (m,).
    """
    starts, sizes = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    ends = np.cumsum(sizes)
    polygon = np.repeat(np.arange(len(counts)), sizes)
    number = np.arange(len(polygon)) - (ends - sizes)[polygon]
    first = starts[polygon]
    triangles = np.stack([first, first + number + 1, first + number + 2], axis=1)
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    areas = np.cross(b - a, c - a)
    polygon_area = np.stack([np.bincount(polygon, areas[:, k], len(counts)) for k in range(3)], axis=1)
    along = np.einsum("mx,mx->m", areas, polygon_area[polygon])
    is_folded = np.zeros(len(counts), dtype=np.bool_)
    is_folded[polygon[along < -FOLDED * np.einsum("mx,mx->m", polygon_area, polygon_area)[polygon]]] = True
    for each in np.flatnonzero(is_folded):
        start, count = starts[each], counts[each]
        rows = slice(ends[each] - sizes[each], ends[each])
        triangles[rows] = start + _ears(_flattened(corners[start : start + count], polygon_area[each]))
    return triangles, polygon


def _flattened(points: FloatArray, normal: FloatArray) -> FloatArray:
    """Project a polygon onto the coordinate plane most perpendicular to its normal, (n, 2).

    The projected polygon runs counterclockwise.
    """
    axis = int(np.abs(normal).argmax())
    axes = [(axis + 1) % 3, (axis + 2) % 3]
    return points[:, axes if normal[axis] > 0.0 else axes[::-1]]


def _ears(points: FloatArray) -> Ints:
    """Triangulate a counterclockwise polygon in the plane, (n - 2, 3), by ear clipping (Meisters, 1975)."""
    remaining, found = list(range(len(points))), []
    index = misses = 0
    while len(remaining) > 3:
        index %= len(remaining)
        if misses == len(remaining):  # self-intersecting or flat: cut off the smallest triangle
            turns = [abs(_turn(*points[_ear(remaining, i)])) for i in range(len(remaining))]
            index, misses = int(np.argmin(turns)), 0
        elif not _is_ear(points, remaining, index):
            index, misses = index + 1, misses + 1
            continue
        found.append(_ear(remaining, index))
        del remaining[index]
        index, misses = index + 1, 0  # skipping a corner gives fewer slivers
    return np.array([*found, remaining], dtype=np.int64)


def _ear(remaining: list[int], index: int) -> list[int]:
    return [remaining[index - 1], remaining[index], remaining[(index + 1) % len(remaining)]]


def _is_ear(points: FloatArray, remaining: list[int], index: int) -> bool:
    """True if a corner is convex and its triangle with both neighbours contains no other corner."""
    corners = points[_ear(remaining, index)]
    if _turn(*corners) <= 0.0:
        return False
    others = points[remaining]
    is_corner = (
        (others[:, None] == corners).all(axis=2).any(axis=1)
    )  # polygons with a cut to a hole contain copies of corners
    sides = [_turn(corners[k], corners[(k + 1) % 3], others.T) for k in range(3)]
    return not bool(((np.min(sides, axis=0) >= 0.0) & ~is_corner).any())


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the area of a triangle in the plane, positive for a counterclockwise triangle."""
    return np.asarray((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
