"""Compute the edges and faces of tetrahedra from index arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import IntArray, name_vertices

# The six edges of a tetrahedron in local vertex numbers.
LOCAL_EDGES: NDArray[np.int64] = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
# Face i lies opposite vertex i. Seen from outside, faces run counterclockwise if the volume is positive.
LOCAL_FACES: NDArray[np.int64] = np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)])


def edges_of(tets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the edges (k, 2), i < j, ascending, and the rows of each tetrahedron's edges, (m, 6)."""
    pairs = np.sort(tets[:, LOCAL_EDGES].reshape(-1, 2), axis=1).astype(np.int64)
    stride = int(tets.max()) + 1
    keys, inverse = np.unique(pairs[:, 0] * stride + pairs[:, 1], return_inverse=True)
    edges = np.stack([keys // stride, keys % stride], axis=1).astype(np.int32)
    return edges, inverse.reshape(-1, 6).astype(np.int32)


def surface_of(tets: IntArray) -> IntArray:
    """Return the triangles that belong to only one tetrahedron, (f, 3), in the order of `tets`.

    The triangles are wound outwards. The tetrahedra must have positive volume.
    Raises: MeshError if more than two tetrahedra share a face, or if two tetrahedra lie on the same side of
        their common face.
    """
    faces = tets[:, LOCAL_FACES].reshape(-1, 3)
    order, starts, counts = groups(np.sort(faces, axis=1))
    if counts.max() > 2:
        start = starts[int(np.argmax(counts))]
        face = order[start]
        owners = sorted(int(row) // 4 for row in order[start : start + counts.max()])
        raise MeshError(
            f"face with vertices {name_vertices(faces[face])} is shared by {len(owners)} tetrahedra "
            f"({', '.join(map(str, owners))}): at most two can meet in a face, repair the mesh"
        )
    first, second = order[starts[counts == 2]], order[starts[counts == 2] + 1]
    # Neighbours lie on opposite sides of their common face, so they traverse the face in opposite directions.
    folded = _is_ascending(faces[first]) == _is_ascending(faces[second])
    if folded.any():
        pair = int(np.argmax(folded))
        raise MeshError(
            f"tetrahedra {first[pair] // 4} and {second[pair] // 4} lie on the same side of the face they "
            f"share (vertices {name_vertices(faces[first[pair]])}): they overlap, repair the mesh"
        )
    return np.ascontiguousarray(faces[np.sort(order[starts[counts == 1]])])


def shared_faces(tets: NDArray[Any]) -> NDArray[np.int64]:
    """Return the pairs of coincident faces, (k, 2). Face i of tetrahedron t has the number 4 t + i.

    A face must not belong to more than two tetrahedra.
    """
    flat = np.sort(tets[:, LOCAL_FACES], axis=2).reshape(-1, 3)
    order = np.lexsort(flat.T)
    same = (flat[order][1:] == flat[order][:-1]).all(axis=1)
    return np.stack([order[:-1][same], order[1:][same]], axis=1)


def first_duplicate(tets: IntArray) -> tuple[int, int] | None:
    """Return the first two rows with the same four vertices, ascending, or None if there are no such rows."""
    order, starts, counts = groups(np.sort(tets, axis=1))
    if counts.max() == 1:
        return None
    start = starts[int(np.argmax(counts > 1))]
    first, second = sorted(order[start : start + 2].tolist())
    return first, second


def groups(rows: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Group equal rows. Returns: the order that sorts the rows, and the start and size of each group."""
    order = np.lexsort(rows.T[::-1])
    in_order = rows[order]
    starts = np.flatnonzero(np.r_[True, (in_order[1:] != in_order[:-1]).any(axis=1)])
    return order, starts, np.diff(np.r_[starts, len(rows)])


def _is_ascending(faces: NDArray[Any]) -> NDArray[np.bool_]:
    """True for triangles whose vertices are in ascending cyclic order."""
    a, b, c = faces.T
    is_ascending: NDArray[np.bool_] = ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))
    return is_ascending
