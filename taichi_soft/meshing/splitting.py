"""Separate tetrahedra along their faces by duplicating vertices (thesis chapter 7)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import IntArray
from taichi_soft.meshing.topology import groups

_FACES = [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]


class InnerFaces(NamedTuple):
    """Faces between two tetrahedra."""

    tets: NDArray[np.int64]  # (f, 2) tetrahedra that share each face, the lower number first
    corners: NDArray[np.int64]  # (f, 2, 3) the face's local corners in both tetrahedra, in the same order


def inner_faces(tets: IntArray) -> InnerFaces:
    """Return all faces that two tetrahedra share."""
    # If the corners of a tetrahedron are in ascending order, the corners of its faces are too.
    corners = np.argsort(tets, axis=1)[:, _FACES].reshape(-1, 3)
    rows, starts, counts = groups(tets.repeat(4, axis=0)[np.arange(len(corners))[:, None], corners])
    pairs = np.stack([rows[starts[counts == 2]], rows[starts[counts == 2] + 1]], axis=1)
    return InnerFaces(pairs // 4, corners[pairs])


def split_vertices(
    tets: IntArray, vertex_count: int, faces: InnerFaces, is_cut: NDArray[np.bool_]
) -> tuple[IntArray, NDArray[np.int64]]:
    """Separate tetrahedra that are connected only through cut faces.

    Around a vertex of a cut face, the tetrahedra form groups that are connected by faces without a cut. The
    group with the first tetrahedron keeps the vertex. Every other group gets a copy of the vertex.
    Args:
        is_cut: True for each of `faces` that is cut, (f,).
    Returns: the tetrahedra with their new vertices, (m, 4), and the original of each vertex, (n,). Old
        vertices keep their numbers and are their own originals.
    """
    if not is_cut.any():
        return tets, np.arange(vertex_count)
    is_touched = np.zeros(vertex_count, dtype=np.bool_)
    cut_tets, cut_corners = faces.tets[is_cut], faces.corners[is_cut]
    is_touched[tets[cut_tets[:, :1], cut_corners[:, 0]]] = True

    flat = tets.ravel()
    loose = np.flatnonzero(is_touched[flat])  # corners of tetrahedra whose vertex can be split
    row = np.full(len(flat), -1)
    row[loose] = np.arange(len(loose))
    links = row[
        (4 * faces.tets[~is_cut][:, :, None] + faces.corners[~is_cut]).transpose(1, 0, 2).reshape(2, -1)
    ]
    group = connected(len(loose), *links[:, links[0] >= 0])

    owners, first = flat[loose], np.unique(group)  # a group is identified by its lowest corner
    by_vertex = first[np.lexsort((first, owners[first]))]
    is_copy = owners[by_vertex] == np.r_[-1, owners[by_vertex[:-1]]]
    new_index = np.zeros(len(loose), dtype=np.int64)
    new_index[by_vertex] = owners[by_vertex]
    new_index[by_vertex[is_copy]] = vertex_count + np.arange(is_copy.sum())
    split = flat.astype(np.int32)
    split[loose] = new_index[group]
    return split.reshape(-1, 4), np.r_[np.arange(vertex_count), owners[by_vertex[is_copy]]]


def loose_parts(tets: IntArray, vertex_count: int) -> NDArray[np.int64]:
    """Return the component number of each tetrahedron, (m,). Components have no vertex in common.

    Components are numbered from 0, in the order of their first tetrahedra.
    """
    label = connected(vertex_count, tets[:, :3].ravel(), tets[:, 1:].ravel())[tets[:, 0]]
    _, first, part = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.asarray(rank[part.reshape(-1)])


def connected(count: int, first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.int64]:
    """Return the lowest number that is connected to each of the numbers 0 to `count` - 1, (count,).

    Each number in `first` is connected to the number in the same row of `second`.
    """
    label = np.arange(count)
    while True:
        ends = label[first], label[second]
        low = np.minimum(*ends)
        before = label.copy()
        for end in ends:  # update labels instead of numbers, so that paths halve in each pass
            np.minimum.at(label, end, low)
        label = label[label]
        if (label == before).all():
            return label
