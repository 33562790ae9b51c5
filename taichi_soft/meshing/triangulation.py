"""Polygons with three or more corners in space, cut into triangles within them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

FOLDED = 1e-9
"""Part of a polygon's area below which a triangle that faces the other way counts as flat."""


def triangulated(corners: FloatArray, counts: Ints) -> tuple[Ints, Ints]:
    """Triangles of polygons: fans where these lie within the polygon, and ears cut off elsewhere.

    Args:
        corners: of all polygons in turn, (k, 3).
        counts: number of corners of each polygon, (f,). One with fewer than three makes no triangle.
    Returns: rows of `corners` (m, 3), in the order and the sense of the polygons, and the polygon of each
        triangle (m,).
    """
    starts, sizes = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    ends = np.cumsum(sizes)
    polygon = np.repeat(np.arange(len(counts)), sizes)
    number = np.arange(len(polygon)) - (ends - sizes)[polygon]
    first = starts[polygon]
    triangles = np.stack([first, first + number + 1, first + number + 2], axis=1)
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    areas = np.cross(b - a, c - a)
    whole = np.stack([np.bincount(polygon, areas[:, k], len(counts)) for k in range(3)], axis=1)
    along = np.einsum("mx,mx->m", areas, whole[polygon])
    is_folded = np.zeros(len(counts), dtype=np.bool_)
    is_folded[polygon[along < -FOLDED * np.einsum("mx,mx->m", whole, whole)[polygon]]] = True
    for each in np.flatnonzero(is_folded):
        start, count = starts[each], counts[each]
        its = slice(ends[each] - sizes[each], ends[each])
        triangles[its] = start + _ears(_flattened(corners[start : start + count], whole[each]))
    return triangles, polygon


def _flattened(points: FloatArray, normal: FloatArray) -> FloatArray:
    """Points (n, 2) in the plane of two axes that lies most squarely to the normal, counterclockwise."""
    axis = int(np.abs(normal).argmax())
    axes = [(axis + 1) % 3, (axis + 2) % 3]
    return points[:, axes if normal[axis] > 0.0 else axes[::-1]]


def _ears(points: FloatArray) -> Ints:
    """Triangles (n - 2, 3) of a polygon in the plane, counterclockwise: ear clipping (Meisters, 1975)."""
    left, found = list(range(len(points))), []
    at = misses = 0
    while len(left) > 3:
        at %= len(left)
        if misses == len(left):  # it crosses itself or is flat: the corner that turns least goes
            turns = [abs(_turn(*points[_ear(left, i)])) for i in range(len(left))]
            at, misses = int(np.argmin(turns)), 0
        elif not _is_ear(points, left, at):
            at, misses = at + 1, misses + 1
            continue
        found.append(_ear(left, at))
        del left[at]
        at, misses = at + 1, 0  # the next corner but one: fewer slivers than from one corner on
    return np.array([*found, left], dtype=np.int64)


def _ear(left: list[int], at: int) -> list[int]:
    return [left[at - 1], left[at], left[(at + 1) % len(left)]]


def _is_ear(points: FloatArray, left: list[int], at: int) -> bool:
    """Whether the corner is convex, and no other lies in the triangle with its neighbours."""
    corners = points[_ear(left, at)]
    if _turn(*corners) <= 0.0:
        return False
    others = points[left]
    is_corner = (others[:, None] == corners).all(axis=2).any(axis=1)  # a hole joined by a cut has copies
    sides = [_turn(corners[k], corners[(k + 1) % 3], others.T) for k in range(3)]
    return not bool(((np.min(sides, axis=0) >= 0.0) & ~is_corner).any())


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the area of a triangle in the plane, positive where it is counterclockwise."""
    return np.asarray((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
