"""Overlap of two bodies and distance of two ropes, in NumPy float64, independent of the library's contact."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Body

Floats = NDArray[np.float64]

POINTS_PER_EDGE = 7
"""Number of points on each surface edge that are tested."""


def surface_edges(triangles: NDArray[Any]) -> NDArray[Any]:
    """Return the edges of triangles, (k, 2), each once."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(np.sort(sides, axis=1), axis=0)


def points_on_edges(body: Body) -> Floats:
    """Return points on the edges of a body's surface, or on the edges of a rope, (n, 3) [m]."""
    x = body.positions().astype(np.float64)
    edges = surface_edges(body.surface) if len(body.surface) else np.asarray(body.mesh.edges)
    along = np.linspace(0.0, 1.0, POINTS_PER_EDGE)[:, None, None]
    points: Floats = ((1.0 - along) * x[edges[:, 0]] + along * x[edges[:, 1]]).reshape(-1, 3)
    return points


def depth_in(body: Body, points: Floats) -> float:
    """Return the largest depth of points in a body of tetrahedra [m]; 0 if all points are outside.

    A point is inside if its barycentric coordinates in a tetrahedron are not negative. Its depth is its
    distance from the nearest plane of a surface triangle.
    """
    x = body.positions().astype(np.float64)
    lower, upper = x.min(axis=0), x.max(axis=0)
    points = points[((points > lower) & (points < upper)).all(axis=1)]
    if not len(points):
        return 0.0
    corners = x[body.tets]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    valid = np.abs(np.linalg.det(edges)) > 1e-15
    inverse = np.linalg.inv(edges[valid])
    inside = np.zeros(len(points), dtype=bool)
    for first in range(0, len(inverse), 512):  # in parts, because the arrays are large
        part = slice(first, first + 512)
        offset = points[None] - corners[valid][part, :1]
        rest = np.einsum("mab,mnb->mna", inverse[part], offset)
        # With a slack, because a point can lie in a face between two tetrahedra.
        inside |= ((rest > -1e-9).all(axis=2) & (rest.sum(axis=2) < 1.0 + 1e-9)).any(axis=0)
    if not inside.any():
        return 0.0
    a, b, c = np.moveaxis(x[body.surface], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    heights = np.abs(np.einsum("fa,nfa->nf", normal, points[inside][:, None] - a[None]))
    return float(heights.min(axis=1).max())


def overlap(first: Body, second: Body) -> float:
    """Return the largest depth of the edges of two bodies in each other [m]. Only solids have an inside."""
    pairs = (first, second), (second, first)
    return max(depth_in(body, points_on_edges(other)) if len(body.tets) else 0.0 for body, other in pairs)


def depth_through(sheet: Body, other: Body) -> float:
    """Return how far the edges of another body reach through the triangles of a sheet [m]; 0 if none does.

    The ends of such an edge lie on both sides of the triangle, and the edge has the three sides of the
    triangle on the same hand: the volumes of the tetrahedra that it spans with them have equal signs. Its
    depth is the distance of the nearer end from the triangle, or of the point where it passes from the sides
    of the triangle, whichever is smaller.
    """
    x, y = sheet.positions().astype(np.float64), other.positions().astype(np.float64)
    a, b, c = (x[sheet.surface[:, k]] for k in range(3))
    edges = surface_edges(other.surface) if len(other.surface) else np.asarray(other.mesh.edges)
    p, q = (y[edges[:, k]] for k in range(2))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    levels = (a * normal).sum(axis=1)
    heights = p @ normal.T - levels, q @ normal.T - levels
    edge, triangle = np.nonzero(heights[0] * heights[1] < 0.0)
    start, along = p[edge], (q - p)[edge]
    corners = [each[triangle] - start for each in (a, b, c)]
    hands = [(along * np.cross(corners[k - 1], corners[k])).sum(axis=1) > 0.0 for k in range(3)]
    passes = (hands[0] == hands[1]) & (hands[1] == hands[2])
    ends = [np.abs(each[edge, triangle]) for each in heights]
    part = (ends[0] / (ends[0] + ends[1]))[:, None]
    places = [part * along - each for each in corners]  # from each corner to where the edge passes
    sides = [corners[k] - corners[k - 1] for k in range(3)]
    aside = [
        np.linalg.norm(np.cross(place, side), axis=1) / np.maximum(np.linalg.norm(side, axis=1), 1e-30)
        for place, side in zip(places, sides, strict=True)
    ]
    return float(np.min([*ends, *aside], axis=0)[passes].max(initial=0.0))


def may_touch(first: Body, second: Body, margin: float) -> bool:
    """True if the boxes around two bodies are at most `margin` apart [m]."""
    x, y = first.positions(), second.positions()
    return bool((x.min(0) - margin < y.max(0)).all() and (y.min(0) - margin < x.max(0)).all())


def segment_distances(p: Floats, q: Floats, r: Floats, s: Floats) -> Floats:
    """Return the distances of the segments from p to q and from r to s, row by row, (n,) [m]."""
    d, e, w = q - p, s - r, p - r
    a, b, c = (d * d).sum(-1), (d * e).sum(-1), (e * e).sum(-1)
    f, g = (d * w).sum(-1), (e * w).sum(-1)
    t = np.clip((b * g - c * f) / np.maximum(a * c - b * b, 1e-30), 0.0, 1.0)
    u = np.clip((b * t + g) / np.maximum(c, 1e-30), 0.0, 1.0)
    t = np.clip((b * u - f) / np.maximum(a, 1e-30), 0.0, 1.0)
    distances: Floats = np.linalg.norm(w + t[..., None] * d - u[..., None] * e, axis=-1)
    return distances


def rope_distance(first: Body, second: Body, skip: int = 0) -> float:
    """Return the smallest distance of the edges of two ropes [m].

    Args: skip: for a rope and itself, edges with numbers that differ by up to this number are neighbours.
    """
    x, y = first.positions().astype(np.float64), second.positions().astype(np.float64)
    mine, theirs = np.asarray(first.mesh.edges), np.asarray(second.mesh.edges)
    i, k = np.meshgrid(np.arange(len(mine)), np.arange(len(theirs)), indexing="ij")
    chosen = k > i + skip if first is second else np.ones(i.shape, dtype=bool)
    own, other = mine[i[chosen]], theirs[k[chosen]]
    ends = x[own[:, 0]], x[own[:, 1]], y[other[:, 0]], y[other[:, 1]]
    return float(segment_distances(*ends).min())
