"""Cavities (sets of tetrahedra) and the tetrahedra that replace them in flips, collapses and vertex moves.

The mesh is closed by a virtual vertex OUTSIDE: an additional tetrahedron joins this vertex to each surface
triangle. Tetrahedra then surround each surface vertex completely, so changes of the surface need no special
case.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.quality import FLATTEST
from taichi_soft.meshing.topology import LOCAL_EDGES, LOCAL_FACES

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

OUTSIDE = 0
LARGEST_RING = 7  # largest number of tetrahedra around a removable edge; a ring of 7 has 42 triangulations
# Entry (i, j) has the other two corners k and l, in the order that makes (i, j, k, l) an even permutation.
_OPPOSITE = np.zeros((4, 4, 2), dtype=np.int64)
for _face in range(4):
    for _turn in range(3):
        _OPPOSITE[_face, np.roll(LOCAL_FACES[_face], _turn)[0]] = np.roll(LOCAL_FACES[_face], _turn)[1:]


class Cavities(NamedTuple):
    """Sets of tetrahedra, and replacements with the same boundary. All arrays are sorted by cavity."""

    removed: Ints  # (r,) rows of the removed tetrahedra in the mesh
    removed_of: Ints  # (r,) cavity of each removed row
    added: Ints  # (a, 4) vertices of the new tetrahedra
    added_of: Ints  # (a,) cavity of each new tetrahedron
    parent: Ints  # (a,) row that each new tetrahedron replaces; -1 if it replaces several rows

    @property
    def total(self) -> int:
        """Number of cavities."""
        return int(self.removed_of[-1]) + 1 if len(self.removed_of) else 0

    def in_rows(self, rows: Ints) -> Cavities:
        """Return the cavities with each row i replaced by `rows[i]`.

        Use this to convert rows of a part of a mesh to rows of the whole mesh.
        """
        return self._replace(
            removed=rows[self.removed], parent=np.where(self.parent < 0, -1, rows[self.parent])
        )

    def kept(self, keep: Bools) -> Cavities:
        """Return the cavities for which `keep` is True, renumbered from 0.

        Args: keep: one entry for each cavity.
        """
        new_index = np.cumsum(keep) - 1
        is_removed, is_added = keep[self.removed_of], keep[self.added_of]
        return Cavities(
            self.removed[is_removed],
            new_index[self.removed_of[is_removed]],
            self.added[is_added],
            new_index[self.added_of[is_added]],
            self.parent[is_added],
        )


class ClosedMesh:
    """Adjacency of the closed mesh, including the tetrahedra outside the surface."""

    def __init__(self, tets: Ints, keys: NDArray[np.uint64]) -> None:
        self.tets = tets
        self.keys = keys
        self._by_vertex = np.argsort(tets.ravel(), kind="stable") // 4
        self._counts = np.bincount(tets.ravel(), minlength=len(keys))
        self._starts = np.cumsum(self._counts) - self._counts
        corner = keys[tets]
        tet_keys = corner.sum(axis=1)
        self._face_keys = tet_keys[:, None] - corner
        edge_keys = corner[:, LOCAL_EDGES].sum(axis=2)
        self._simplex_keys = np.unique(np.concatenate([tet_keys, self._face_keys.ravel(), edge_keys.ravel()]))

    def star(self, vertices: Ints) -> tuple[Ints, Ints]:
        """Find the tetrahedra around vertices, sorted by vertex.

        Returns: row of each tetrahedron, (r,), and index in `vertices` of the tetrahedron's vertex, (r,).
        """
        counts = self._counts[vertices]
        of = np.repeat(np.arange(len(vertices)), counts)
        return self._by_vertex[ranges(self._starts[vertices], counts)], of

    def has(self, simplices: Ints) -> Bools:
        """True for edges (k, 2), triangles (k, 3) or tetrahedra (k, 4) that are part of the mesh."""
        key = self.keys[simplices].sum(axis=1)
        place = np.minimum(np.searchsorted(self._simplex_keys, key), len(self._simplex_keys) - 1)
        return np.asarray(self._simplex_keys[place] == key)

    def neighbours(self) -> Ints:
        """Return the row of the tetrahedron on the other side of each face, (m, 4)."""
        order = np.argsort(self._face_keys.ravel(), kind="stable")
        key = self._face_keys.ravel()[order]
        first = np.flatnonzero(key[1:] == key[:-1])
        rows = np.zeros(len(order), dtype=np.int64)
        rows[order[first]], rows[order[first + 1]] = order[first + 1] // 4, order[first] // 4
        return rows.reshape(-1, 4)


def ranges(starts: Ints, counts: Ints) -> Ints:
    """Concatenate the ranges start, start + 1, ..., start + count - 1."""
    return np.repeat(starts - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())


def sizes(x: FloatArray, tets: Ints) -> FloatArray:
    """Return the size of each tetrahedron, (k,) [m].

    The size is the edge length of a regular tetrahedron with the same sum of squared shape function
    gradients. It is negative for an inverted tetrahedron and infinite for a tetrahedron outside the surface.
    """
    p = x.T[:, tets.T]
    a, b, c = (p[:, i] - p[:, 0] for i in (1, 2, 3))
    normals = _cross(b, c), _cross(c, a), _cross(a, b)
    volume = (a * normals[0]).sum(axis=0)
    areas = sum((n * n).sum(axis=0) for n in (*normals, normals[0] + normals[1] + normals[2]))
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(areas > 0, np.sqrt(6.0) * volume / np.sqrt(areas), -np.inf)
    return np.where((tets == OUTSIDE).any(axis=1), np.inf, size)


def size_slopes(x: FloatArray, tets: Ints, vertices: Ints) -> FloatArray:
    """Return the gradient of each tetrahedron's size with respect to the position of one corner, (k, 3).

    The gradient is a central difference.
    Args: vertices: vertex index of this corner, (k,).
    """
    rows, corner = np.arange(len(tets)), (tets == vertices[:, None]).argmax(axis=1)
    own = 1 + np.arange(4 * len(tets)).reshape(-1, 4)
    step = 1e-6 * np.linalg.norm(np.ptp(x[tets], axis=1), axis=1)

    def at(axis: int, side: int) -> FloatArray:
        p = x[tets]
        p[rows, corner, axis] += side * step
        return sizes(np.concatenate([np.zeros((1, 3)), p.reshape(-1, 3)]), own)

    return np.stack([(at(axis, 1) - at(axis, -1)) / (2 * step) for axis in range(3)], axis=1)


def volumes(x: FloatArray, tets: Ints) -> FloatArray:
    """Return the signed volumes of tetrahedra, (k,) [m^3].

    The volume is 0 for tetrahedra that contain the virtual vertex `OUTSIDE`.
    """
    p = x[tets]
    six = np.einsum("ij,ij->i", p[:, 1] - p[:, 0], np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 0]))
    return np.where((tets == OUTSIDE).any(axis=1), 0.0, six / 6.0)


def is_flat(x: FloatArray, tets: Ints) -> Bools:
    """True for tetrahedra (k, 4) that are so flat that `TetMesh` rejects or nearly rejects them."""
    ends = x[tets[:, LOCAL_EDGES]]
    longest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
    flat = volumes(x, tets) <= 2 * FLATTEST * longest**3
    return np.asarray(flat & (tets != OUTSIDE).all(axis=1))


def collapses(mesh: ClosedMesh, removed: Ints, target: Ints) -> Cavities:
    """Return the cavities that replace each vertex of `removed` by the vertex of `target`, (k,) each.

    If the target is a neighbour, the edge collapses. If the target is a new vertex, the vertex moves.
    """
    rows, of = mesh.star(removed)
    tets = mesh.tets[rows]
    stay = ~(tets == target[of, None]).any(axis=1)
    added = np.where(tets[stay] == removed[of[stay], None], target[of[stay], None], tets[stay])
    return Cavities(rows, of, added, of[stay], rows[stay])


def meets_link_condition(mesh: ClosedMesh, removed: Ints, target: Ints) -> Bools:
    """True for collapses that keep the topology, (k,).

    A collapse keeps the topology if each simplex in the links of both vertices is in the link of their edge.
    """
    rows, of = mesh.star(removed)
    tets = mesh.tets[rows]
    far = ~(tets == target[of, None]).any(axis=1)
    tets, of = tets[far], of[far]
    link = tets[tets != removed[of, None]].reshape(-1, 3)
    u, v = removed[of, None], target[of, None]
    wrong = mesh.has(np.hstack([v, link]))
    for i in range(3):
        vertex, edge = link[:, [i]], np.delete(link, i, axis=1)
        wrong |= mesh.has(np.hstack([v, vertex])) & ~mesh.has(np.hstack([u, v, vertex]))
        wrong |= mesh.has(np.hstack([v, edge])) & ~mesh.has(np.hstack([u, v, edge]))
    return np.asarray(np.bincount(of[wrong], minlength=len(removed)) == 0)


def face_flips(mesh: ClosedMesh, rows: Ints) -> Cavities:
    """Return the flips that replace two tetrahedra at a face of `rows` by three around a new edge."""
    row, corner = np.repeat(rows, 4), np.tile(np.arange(4), len(rows))
    neighbour = mesh.neighbours()[row, corner]
    apex = mesh.tets[row, corner]
    opposite = mesh.tets[neighbour].sum(axis=1) - (mesh.tets[row].sum(axis=1) - apex)
    new = ~mesh.has(np.stack([apex, opposite], axis=1))
    row, corner, neighbour, opposite = row[new], corner[new], neighbour[new], opposite[new]
    added = np.repeat(mesh.tets[row], 3, axis=0)
    added[np.arange(len(added)), ((corner[:, None] + [1, 2, 3]) % 4).ravel()] = np.repeat(opposite, 3)
    of = np.arange(len(row))
    removed = np.stack([row, neighbour], axis=1).ravel()
    return Cavities(removed, of.repeat(2), added, of.repeat(3), np.full(len(added), -1))


def edge_removals(x: FloatArray, mesh: ClosedMesh, edges: Ints) -> list[Cavities]:
    """Return the flips that replace the tetrahedra around each edge (k, 2) by tetrahedra without this edge.

    The new tetrahedra belong to the best triangulation of the ring around the edge.
    Returns: one `Cavities` for each ring size that occurs, from 3 to `LARGEST_RING`.
    """
    rows, of = mesh.star(edges[:, 0])
    shares_edge = (mesh.tets[rows] == edges[of, 1, None]).any(axis=1)
    rows, of = rows[shares_edge], of[shares_edge]
    counts = np.bincount(of, minlength=len(edges))
    return [
        _ring_fills(x, mesh, edges[counts == n], rows[counts[of] == n].reshape(-1, n))
        for n in range(3, LARGEST_RING + 1)
        if (counts == n).any()
    ]


def _ring_fills(x: FloatArray, mesh: ClosedMesh, edges: Ints, rows: Ints) -> Cavities:
    """Return the flips that replace the n tetrahedra around each edge by the best triangulation of the ring.

    Args:
        edges: (k, 2).
        rows: tetrahedra around each edge, (k, n).
    """
    count, n = rows.shape
    tets = mesh.tets[rows]
    ends_at = [(tets == edges[:, None, end, None]).argmax(axis=2) for end in (0, 1)]
    links = np.take_along_axis(tets, _OPPOSITE[ends_at[0], ends_at[1]], axis=2)
    ring = np.empty((count, n + 1), dtype=np.int64)
    ring[:, 0] = links[:, 0, 0]
    for i in range(n):
        step = (links[:, :, 0] == ring[:, i, None]).argmax(axis=1)
        ring[:, i + 1] = links[np.arange(count), step, 1]
    ordered = np.sort(ring[:, :n], axis=1)
    closes = (ring[:, n] == ring[:, 0]) & (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    triples, fills, chords = _triangulations(n)
    corners = ring[:, triples]  # (count, triples, 3)
    ends = np.broadcast_to(edges[:, None], (*corners.shape[:2], 2))
    i, j, k = np.moveaxis(corners, 2, 0)
    tips = np.stack(
        [np.stack([k, ends[..., 1], i, j], axis=2), np.stack([ends[..., 0], k, i, j], axis=2)], axis=2
    )  # (count, triples, 2, 4)
    worst = sizes(x, tips.reshape(-1, 4)).reshape(*corners.shape[:2], 2).min(axis=2)
    # A new inner simplex (a chord, or the triangle of a ring of three) must not exist elsewhere in the mesh.
    if n == 3:
        worst[mesh.has(corners[:, 0]), 0] = -np.inf
    else:
        exists = mesh.has(ring[:, chords].reshape(-1, 2)).reshape(count, len(chords))
        sides = (chords[:, None, :, None] == triples[None, :, None, :]).any(axis=3).all(axis=2)
        worst[(exists[:, :, None] & sides).any(axis=1)] = -np.inf
    worst[~closes] = -np.inf
    best = worst[:, fills].min(axis=2).argmax(axis=1)
    added = tips[np.arange(count)[:, None], fills[best]].reshape(-1, 4)
    of = np.arange(count)
    good = Cavities(rows.ravel(), of.repeat(n), added, of.repeat(2 * (n - 2)), np.full(len(added), -1))
    return good.kept(worst[of[:, None], fills[best]].min(axis=1) > 0)


@cache
def _triangulations(n: int) -> tuple[Ints, Ints, Ints]:
    """Return all vertex triples of a ring of n vertices, (t, 3); its triangulations, each as indices of n - 2
    triples, (w, n - 2); and its chords, (c, 2).
    """

    def fill(i: int, j: int) -> list[list[tuple[int, int, int]]]:
        return [
            [(i, k, j), *left, *right] for k in range(i + 1, j) for left in fill(i, k) for right in fill(k, j)
        ] or [[]]

    triples = list(combinations(range(n), 3))
    fills = [[triples.index(triple) for triple in triangulation] for triangulation in fill(0, n - 1)]
    chords = [pair for pair in combinations(range(n), 2) if pair[1] - pair[0] not in (1, n - 1)]
    return np.array(triples), np.array(fills), np.array(chords, dtype=np.int64).reshape(-1, 2)


def joined(parts: list[Cavities]) -> Cavities:
    """Concatenate lists of cavities and renumber the cavities."""
    shift = 0
    shifted: list[tuple[Any, ...]] = []
    for part in parts:
        shifted.append(
            (part.removed, part.removed_of + shift, part.added, part.added_of + shift, part.parent)
        )
        shift += part.total
    return Cavities(*(np.concatenate(column) for column in zip(*shifted, strict=True)))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products of the columns of `a` and `b`, (3, k)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
