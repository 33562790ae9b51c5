"""Attributes of triangle corners: texture coordinates, normals, colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

NONE = -1
"""Value in `Attribute.at` for a corner without the attribute."""

BEFORE_FIRST = 1 << 40
"""Row number for a negative index that points before the first row. It is larger than any table, so checks
reject it like any other row beyond the table."""


@dataclass(frozen=True, eq=False)
class Attribute:
    """One attribute of triangle corners: a table of values, and the row of the table for each corner."""

    rows: FloatArray  # (r, d)
    at: Ints  # (m, 3), row of each corner, or NONE


@dataclass(frozen=True, eq=False)
class Split:
    """Result of `split`. Each vertex has at most one value of each attribute.

    The vertices of the file are the first vertices, in the order of the file. Copies follow, ordered by the
    vertex that they copy, then by their first corners.
    """

    vertex: Ints  # (n,), vertex of the file from which each vertex is copied
    triangles: Ints  # (m, 3)
    attributes: tuple[FloatArray, ...]  # (n, d) each, NaN for vertices without the attribute


def split(vertex_count: int, triangles: Ints, attributes: tuple[Attribute, ...], *, keep: bool) -> Split:
    """Duplicate vertices whose corners have different attribute values.

    Args:
        vertex_count: number of vertices of the file.
        triangles: (m, 3), vertices of the file.
        keep: True to keep vertices without triangles, so that vertices keep their numbers in the file.
    """
    corners = triangles.reshape(-1).astype(np.int64)
    labels, key = [_labels(each) for each in attributes], corners
    for label in labels:
        key = np.unique(key * (label.max(initial=0) + 1) + label, return_inverse=True)[1].reshape(-1)
    first = np.unique(key, return_index=True)[1] if labels else np.unique(corners, return_index=True)[1]
    kind = key if labels else np.unique(corners, return_inverse=True)[1].reshape(-1)
    order = np.lexsort((first, corners[first]))
    first = first[order]  # one corner for each new vertex, sorted by vertex of the file
    file_vertex = corners[first]
    is_copy = np.r_[False, file_vertex[1:] == file_vertex[:-1]]
    new_index = np.empty(len(first), dtype=np.int64)
    if keep:
        vertex = np.r_[np.arange(vertex_count), file_vertex[is_copy]]
        new_index[~is_copy] = file_vertex[~is_copy]
    else:
        vertex = np.r_[file_vertex[~is_copy], file_vertex[is_copy]]
        new_index[~is_copy] = np.arange((~is_copy).sum())
    new_index[is_copy] = len(vertex) - is_copy.sum() + np.arange(is_copy.sum())
    renumbered = np.empty(len(first), dtype=np.int64)
    renumbered[order] = new_index
    return Split(
        vertex,
        renumbered[kind].reshape(-1, 3),
        tuple(_rows(each, first, new_index, len(vertex)) for each in attributes),
    )


def require_vertices(corners: Ints, counts: Ints, vertex_count: int) -> None:
    """Check that faces name only existing vertices. Raises: MeshError if a vertex does not exist."""
    outside = (corners < 0) | (corners >= vertex_count)
    if outside.any():
        at = int(np.argmax(outside))
        face = int(np.searchsorted(np.cumsum(counts), at, side="right"))
        named = (
            f"vertex {int(corners[at])}"
            if 0 <= corners[at] < BEFORE_FIRST
            else "a vertex before the first one"
        )
        raise MeshError(
            f"face {face} names {named}, but the file has {vertex_count:,} vertices, counted from 0: it is "
            "cut short or damaged, export it again"
        )


def _labels(attribute: Attribute) -> Ints:
    """Number the distinct values of an attribute. Returns: number of the value at each corner, (3 m,)."""
    at = attribute.at.reshape(-1)
    if len(attribute.rows) == 0:
        return np.zeros(len(at), dtype=np.int64)
    rows = np.ascontiguousarray(attribute.rows + 0.0)  # turns -0.0 into 0.0
    values = np.unique(rows.view(f"V{rows.itemsize * rows.shape[1]}").reshape(-1), return_inverse=True)[1]
    return np.where(at == NONE, 0, values.reshape(-1)[at] + 1)


def _rows(attribute: Attribute, first: Ints, new_index: Ints, count: int) -> FloatArray:
    rows = np.full((count, attribute.rows.shape[1]), np.nan)
    at = attribute.at.reshape(-1)[first]
    rows[new_index[at != NONE]] = attribute.rows[at[at != NONE]]
    return rows
