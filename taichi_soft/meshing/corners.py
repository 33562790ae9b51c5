"""Corners of triangles that have more to them than their vertex: texture coordinates, normals, colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]

NONE = -1
"""Row of a corner that lacks an attribute."""

BEYOND = 1 << 40
"""Row of an index that counts back beyond the first row: none has it."""


@dataclass(frozen=True, eq=False)
class Attribute:
    """What corners have beside their vertex: rows of a table."""

    rows: FloatArray  # (r, d)
    at: Ints  # (m, 3), the row of each corner, or NONE


@dataclass(frozen=True, eq=False)
class Split:
    """Vertices that have one row of each attribute.

    The vertices of the file come first, in their order, then copies: by vertex, and those of one vertex in
    the order of their first corners.
    """

    vertex: Ints  # of the file, that each is or is a copy of, (n,)
    triangles: Ints  # (m, 3)
    attributes: tuple[FloatArray, ...]  # (n, d) each, NaN where a vertex has none


def split(vertex_count: int, triangles: Ints, attributes: tuple[Attribute, ...], *, keep: bool) -> Split:
    """Copy vertices where the attributes of their corners differ in value.

    Args:
        vertex_count: of the file.
        triangles: (m, 3), of vertices of the file.
        keep: whether vertices that no triangle has are kept, so that the numbers are those of the file.
    """
    corners = triangles.reshape(-1).astype(np.int64)
    labels, key = [_labels(each) for each in attributes], corners
    for label in labels:
        key = np.unique(key * (label.max(initial=0) + 1) + label, return_inverse=True)[1].reshape(-1)
    first = np.unique(key, return_index=True)[1] if labels else np.unique(corners, return_index=True)[1]
    kind = key if labels else np.unique(corners, return_inverse=True)[1].reshape(-1)
    order = np.lexsort((first, corners[first]))
    first = first[order]  # corners, one for each vertex to be, by vertex of the file
    own = corners[first]
    is_copy = np.r_[False, own[1:] == own[:-1]]
    number = np.empty(len(first), dtype=np.int64)
    if keep:
        vertex = np.r_[np.arange(vertex_count), own[is_copy]]
        number[~is_copy] = own[~is_copy]
    else:
        vertex = np.r_[own[~is_copy], own[is_copy]]
        number[~is_copy] = np.arange((~is_copy).sum())
    number[is_copy] = len(vertex) - is_copy.sum() + np.arange(is_copy.sum())
    renumbered = np.empty(len(first), dtype=np.int64)
    renumbered[order] = number
    return Split(
        vertex,
        renumbered[kind].reshape(-1, 3),
        tuple(_rows(each, first, number, len(vertex)) for each in attributes),
    )


def require_vertices(corners: Ints, counts: Ints, vertex_count: int) -> None:
    """Raises: MeshError for a face that names a vertex which is not there."""
    outside = (corners < 0) | (corners >= vertex_count)
    if outside.any():
        at = int(np.argmax(outside))
        face = int(np.searchsorted(np.cumsum(counts), at, side="right"))
        named = f"vertex {int(corners[at])}" if 0 <= corners[at] < BEYOND else "a vertex before the first one"
        raise MeshError(
            f"face {face} names {named}, and there are {vertex_count:,}, counted from 0: the file is cut "
            "short or damaged, export it anew"
        )


def _labels(attribute: Attribute) -> Ints:
    """A number for each corner, alike for those of equal value, (3 m,)."""
    at = attribute.at.reshape(-1)
    if len(attribute.rows) == 0:
        return np.zeros(len(at), dtype=np.int64)
    rows = np.ascontiguousarray(attribute.rows + 0.0)  # -0.0 is 0.0
    values = np.unique(rows.view(f"V{rows.itemsize * rows.shape[1]}").reshape(-1), return_inverse=True)[1]
    return np.where(at == NONE, 0, values.reshape(-1)[at] + 1)


def _rows(attribute: Attribute, first: Ints, number: Ints, count: int) -> FloatArray:
    found = np.full((count, attribute.rows.shape[1]), np.nan)
    at = attribute.at.reshape(-1)[first]
    found[number[at != NONE]] = attribute.rows[at[at != NONE]]
    return found
