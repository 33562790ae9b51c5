"""Find the edges of a body that touch other edges.

Sharp edges of solids, and all edges of sheets and ropes touch each other. Between flat edges of two solids,
contact of vertices and triangles is enough, because a vertex is always near. Flat edges also touch what can
pass between the vertices of a surface: ropes, and slim edges, which are long sharp edges of narrow solids.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

OF_SHEET, OF_ROPE = -1, -2
"""Stored instead of the opposite corners of an edge that has no inside and outside. Vertices of sheets touch
through their triangles. Ropes have no triangles, so that the ends of their edges touch as well."""

SHARP_COSINE = 0.866
"""Cosine of the smallest angle between the normals at a convex edge that makes it a contact edge: 30 degrees.
For regular triangles of edge a, two flatter edges overlap by up to a / 7 before a vertex touches."""

SLIM = 1.5
"""Ratio from which a sharp edge is slim: its length divided by the height of a triangle at it. A slim edge
touches the flat edges to which it has this ratio of lengths, and which are longer than the height. Between
other edges, a vertex of one body meets a triangle of the other."""


def find_contact_edges(positions: Floats, triangles: Ints, edges: Ints) -> tuple[Ints, int]:
    """Find the contact edges of a body.

    Args:
        positions: positions at rest, (n, 3) [m].
        triangles: triangles of the contact surface, oriented outwards, (f, 3). A sheet has each triangle
            twice, once for each side.
        edges: edges of a body without triangles, (k, 2).
    Returns:
        rows: ends of each edge, and the opposite corners of the two triangles at the edge, (m, 4). The first
            triangle contains the ends in this order, the second triangle in the reverse order. The corners of
            sheets and ropes are `OF_SHEET` or `OF_ROPE`.
        sharp: number of sharp edges, which come first. All edges of sheets and ropes count as sharp.
    """
    if not len(triangles):
        return _all_sharp(np.sort(edges, axis=1), OF_ROPE)
    halves = np.concatenate([triangles[:, [0, 1, 2]], triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]])
    ends = np.sort(halves[:, :2], axis=1)
    order = np.lexsort((halves[:, 0] > halves[:, 1], ends[:, 1], ends[:, 0]))
    halves, ends = halves[order], ends[order]
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    if _is_sheet(triangles):
        return _all_sharp(ends[first], OF_SHEET)
    first = first[count == 2]
    there, back = halves[first], halves[first + 1]
    is_oriented = (there[:, :2] == back[:, 1::-1]).all(axis=1) & (there[:, 2] != back[:, 2])
    rows = np.column_stack([there, back[:, 2]])[is_oriented]
    is_sharp = _is_sharp(positions, rows)
    order = np.lexsort((rows[:, 1], rows[:, 0], ~is_sharp))
    return rows[order].astype(np.int32), int(is_sharp.sum())


def has_slim_edges(positions: Floats, rows: Ints, sharp: int) -> bool:
    """Return whether a solid has slim edges, see `SLIM`; False for sheets and ropes.

    Args: positions, rows, sharp: see `find_contact_edges`.
    """
    rows = rows[:sharp][rows[:sharp, 2] >= 0]
    a, b, c, d = positions[rows].swapaxes(0, 1)
    squares = ((b - a) ** 2).sum(axis=1) ** 2
    heights = [(np.cross(b - a, corner - a) ** 2).sum(axis=1) for corner in (c, d)]
    return bool((SLIM**2 * np.minimum(*heights) <= squares).any())


def _all_sharp(ends: NDArray[np.integer], corners: int) -> tuple[Ints, int]:
    rows = np.column_stack([ends, np.full((len(ends), 2), corners)])
    return rows[np.lexsort((rows[:, 1], rows[:, 0]))].astype(np.int32), len(rows)


def _is_sheet(triangles: Ints) -> bool:
    """True if each triangle also occurs with the opposite orientation."""

    def in_order(rows: Ints) -> Ints:
        smallest = rows.argmin(axis=1)
        columns = (smallest[:, None] + np.arange(3)) % 3
        turned = np.take_along_axis(rows, columns, axis=1)
        return turned[np.lexsort(turned.T)]

    return bool((in_order(triangles) == in_order(triangles[:, ::-1])).all())


def _is_sharp(positions: Floats, rows: Ints) -> NDArray[np.bool_]:
    a, b, c, d = positions[rows].swapaxes(0, 1)
    first, second = np.cross(b - a, c - a), np.cross(d - a, b - a)
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    is_convex = ((d - a) * first).sum(axis=1) < 0.0
    cosine = (first * second).sum(axis=1) / np.maximum(lengths, 1e-300)
    found: NDArray[np.bool_] = is_convex & (lengths > 0.0) & (cosine < SHARP_COSINE)
    return found
