"""Orders of vertices, tetrahedra and edges that keep neighbours in space close in memory."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.meshing.arrays import IntArray, as_indices, as_points

# Number of bits per axis. Three axes fill 63 of the 64 bits of a key.
AXIS_BITS = 21
# Shifts and masks that spread the bits of a 21-bit number, with two zeros after each bit.
SPREAD = (
    (32, 0x1F00000000FFFF),
    (16, 0x1F0000FF0000FF),
    (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3),
    (2, 0x1249249249249249),
)


def spatial_order(vertices: ArrayLike) -> IntArray:
    """Order points along a Morton curve (the bits of x, y and z interleaved).

    Args:
        vertices: (n, 3) [m].
    Returns: int32 (n,), a permutation. The points `vertices[spatial_order(vertices)]` are ordered along the
        curve. Equal points keep their order, so the result is the same on every machine.
    Raises: MeshError if the points are not finite or have the wrong shape.
    """
    points = as_points(vertices)
    low = points.min(axis=0)
    # One scale for all axes, so that cells of the curve are cubes for any proportions of the body.
    extent = float((points.max(axis=0) - low).max())
    fraction = (points - low) / extent if extent > 0 else np.zeros_like(points)
    cells = (fraction * (2**AXIS_BITS - 1)).astype(np.uint64)
    keys = _spread(cells[:, 0]) << np.uint64(2) | _spread(cells[:, 1]) << np.uint64(1) | _spread(cells[:, 2])
    return np.argsort(keys, kind="stable").astype(np.int32)


def tet_order(tets: ArrayLike, vertex_order: ArrayLike) -> IntArray:
    """Order tetrahedra by their renumbered vertices.

    Args:
        tets: (m, 4) vertex indices in the old numbering.
        vertex_order: (n,) permutation, such as `spatial_order` returns. Entry i is the old index of the i-th
            vertex.
    Returns: int32 (m,), a permutation that sorts the rows of `tets` by their lowest new vertex index, then by
        the next. `renumbered(vertex_order)[tets[order]]` is the sorted array with new vertex indices.
    Raises: MeshError if a tetrahedron names a vertex that does not exist.
    """
    new_index = renumbered(vertex_order)
    rows = as_indices(tets, "tets", 4, len(new_index), "tetrahedron")
    keys = np.sort(new_index[rows], axis=1)
    return np.lexsort(keys.T[::-1]).astype(np.int32)


def edge_owners(edges: ArrayLike, vertex_count: int, group: int) -> IntArray:
    """Choose which end owns each edge, so that most vertices own a multiple of `group` edges.

    The method is greedy. First, every vertex takes as many full groups as its edges allow. Then the vertex
    with the most unowned edges takes all of these edges. This step is repeated until every edge has an owner.
    Finally, the edges of partly full groups move to other vertices whose groups have free places. Groups are
    much fuller than if the end with the lower number owned every edge.
    Args:
        edges: (k, 2) vertex indices.
        vertex_count: number of vertices.
        group: number of edges of a full group.
    Returns: vertex that owns each edge, int32 (k,).
    """
    ends = np.asarray(edges).tolist()
    incident: list[list[int]] = [[] for _ in range(vertex_count)]
    for number, pair in enumerate(ends):
        for vertex in pair:
            incident[vertex].append(number)
    unowned = [len(numbers) for numbers in incident]
    owner = [-1] * len(ends)

    def take(vertex: int, count: int) -> None:
        for number in incident[vertex]:
            if count > 0 and owner[number] < 0:
                owner[number] = vertex
                count -= 1
                for end in ends[number]:
                    unowned[end] -= 1

    for vertex in range(vertex_count):
        take(vertex, unowned[vertex] // group * group)
    waiting = [(-count, vertex) for vertex, count in enumerate(unowned) if count > 0]
    heapq.heapify(waiting)
    while waiting:
        count, vertex = heapq.heappop(waiting)
        if unowned[vertex] == -count:
            take(vertex, unowned[vertex])
        elif unowned[vertex] > 0:
            heapq.heappush(waiting, (-unowned[vertex], vertex))
    _move_partial_groups(ends, incident, owner, group)
    return np.array(owner, dtype=np.int32)


def _move_partial_groups(
    ends: list[list[int]], incident: list[list[int]], owner: list[int], group: int
) -> None:
    """Move the edges of partly full groups to the other ends of the edges, least full groups first.

    A group moves only as a whole, to ends whose groups have free places.
    """
    counts = np.bincount(owner, minlength=len(incident)).tolist()
    for _ in range(4):
        before = list(owner)
        for vertex in sorted(range(len(incident)), key=lambda v: counts[v] % group):
            rest = counts[vertex] % group
            moves: list[tuple[int, int]] = []
            room: dict[int, int] = {}
            for number in incident[vertex]:
                if owner[number] == vertex and len(moves) < rest:
                    other = sum(ends[number]) - vertex
                    free = room.setdefault(other, -counts[other] % group)
                    if free > 0:
                        room[other] = free - 1
                        moves.append((number, other))
            if len(moves) == rest:
                counts[vertex] -= rest
                for number, other in moves:
                    owner[number] = other
                    counts[other] += 1
        if owner == before:
            break


def renumbered(order: ArrayLike) -> IntArray:
    """Return the inverse of a permutation, int32 (n,). Entry i is the new index of the old index i."""
    old_index = np.asarray(order)
    new_index: IntArray = np.empty(len(old_index), dtype=np.int32)
    new_index[old_index] = np.arange(len(old_index), dtype=np.int32)
    return new_index


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, mask in SPREAD:
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    return cells
