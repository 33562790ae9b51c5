"""Remove the vertices of a closed surface that do not change its shape.

A vertex inside a flat face, or on a straight crease between two flat faces, is merged into one of its
neighbours. Contact of a rigid body then tests the corners of a box, and not the grid on its faces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

FLAT = 1e-6
"""Largest difference of two unit normals or unit vectors that count as equal."""


def without_flat_vertices(
    points: FloatArray, triangles: NDArray[np.int64]
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return a surface of the same shape without such vertices: points (k, 3), triangles (j, 3)."""
    corners = {t: tuple(int(v) for v in row) for t, row in enumerate(triangles)}
    fans: dict[int, set[int]] = {}
    for t, row in corners.items():
        for v in row:
            fans.setdefault(v, set()).add(t)
    waiting = sorted(fans)
    while waiting:
        v = waiting.pop(0)
        if v not in fans:
            continue
        target = _neighbour_to_merge_into(points, corners, fans, v)
        if target < 0:
            continue
        touched = {u for t in fans[v] for u in corners[t]} - {v}
        for t in sorted(fans[v]):
            row = corners[t]
            if target in row:
                for u in row:
                    fans[u].discard(t)
                del corners[t]
            else:
                corners[t] = tuple(target if u == v else u for u in row)
                fans[target].add(t)
        del fans[v]
        waiting += sorted(touched - set(waiting))
    used = sorted({v for row in corners.values() for v in row})
    rank = {v: i for i, v in enumerate(used)}
    rows = [[rank[v] for v in corners[t]] for t in sorted(corners)]
    return points[used], np.array(rows, dtype=np.int64)


def _neighbour_to_merge_into(
    points: FloatArray, corners: dict[int, tuple[int, ...]], fans: dict[int, set[int]], v: int
) -> int:
    """Return the neighbour into which vertex `v` can be merged without a change of the shape; -1 if none."""
    fan = sorted(fans[v])
    normals = np.array([_normal(points, corners[t]) for t in fan])
    faces = [normals[0]]  # different normals around the vertex
    for normal in normals:
        if all(np.abs(normal - each).max() > FLAT for each in faces):
            faces.append(normal)
    if len(faces) > 2:
        return -1
    neighbours = sorted({u for t in fan for u in corners[t]} - {v})
    candidates = neighbours
    if len(faces) == 2:
        candidates = _along_crease(points, v, neighbours, faces)
    for u in candidates:
        shared = [t for t in fan if u in corners[t]]
        # The two vertices may share no other neighbours, so that the surface stays a manifold.
        common = {w for t in fans[u] for w in corners[t]} & set(neighbours)
        if len(shared) != 2 or len(common - {u}) != 2:
            continue
        moved = [tuple(u if w == v else w for w in corners[t]) for t in fan if u not in corners[t]]
        before = [normals[k] for k, t in enumerate(fan) if u not in corners[t]]
        after = [_normal(points, row) for row in moved]
        if moved and all(np.abs(a - b).max() <= FLAT for a, b in zip(after, before, strict=True)):
            return u
    return -1


def _along_crease(points: FloatArray, v: int, neighbours: list[int], faces: list[FloatArray]) -> list[int]:
    """Return the two neighbours along a straight crease through vertex `v`; nothing if it has a corner."""
    ways = points[neighbours] - points[v]
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-300)
    crease = np.cross(faces[0], faces[1])
    crease /= max(float(np.linalg.norm(crease)), 1e-300)
    forth = [u for u, way in zip(neighbours, ways, strict=True) if np.abs(way - crease).max() <= FLAT]
    back = [u for u, way in zip(neighbours, ways, strict=True) if np.abs(way + crease).max() <= FLAT]
    return [*forth, *back] if forth and back else []


def _normal(points: FloatArray, row: tuple[int, ...]) -> FloatArray:
    """Return the unit normal of a triangle; zero if it has no area."""
    a, b, c = points[list(row)]
    across = np.cross(b - a, c - a)
    length = float(np.linalg.norm(across))
    return np.asarray(across / length if length > 1e-12 * max(np.ptp(points), 1e-300) ** 2 else np.zeros(3))
