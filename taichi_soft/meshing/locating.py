"""Which tetrahedron of a mesh holds a point, or comes nearest to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.topology import LOCAL_FACES, shared_faces

Ints = NDArray[np.int64]

STEPS = 64
"""From tetrahedron to tetrahedron towards a point, before it is looked for on the surface."""

INSIDE = -1e-9
"""Barycentric coordinate from which on a point belongs to a tetrahedron."""

CHUNK = 1 << 20
"""Pairs of points and elements that are looked at together."""

FEW = 1 << 13
"""Points that are looked at together."""


class Locator:
    """Of one mesh at rest."""

    def __init__(self, mesh: TetMesh) -> None:
        """Prepare to look for points."""
        self._corners = mesh.vertices[mesh.tets]
        self._inverses = edge_inverses(self._corners)
        self._neighbours = _neighbours(mesh.tets)
        self._tet, self._face = np.nonzero(self._neighbours < 0)
        self._triangles = self._corners[self._tet[:, None], LOCAL_FACES[self._face]]
        self._on_tets, self._on_triangles = _Bins(self._corners), _Bins(self._triangles)

    def __call__(self, points: FloatArray, start: Ints | None = None) -> tuple[Ints, FloatArray]:
        """Tetrahedron of each of `points` (k, 3), (k,), and barycentric coordinates of the point of it that
        is nearest, (k, 4), none below 0.

        Args: start: tetrahedron from which to walk, (k,), -1 where none is known.
        """
        tet = np.full(len(points), -1) if start is None else start.copy()
        unknown = tet < 0
        tet[unknown] = self._on_tets.any_at(points[unknown])
        tet, shares = self._walk(points, tet)
        outside = np.flatnonzero(shares.min(axis=1) < INSIDE)
        for first in range(0, len(outside), FEW):
            self._find_outside(points, outside[first : first + FEW], tet, shares)
        shares = np.maximum(shares, 0.0)
        return tet, shares / shares.sum(axis=1, keepdims=True)

    def _find_outside(self, points: FloatArray, rows: Ints, tet: Ints, shares: FloatArray) -> None:
        """Put the nearest point of the mesh in the place of what a walk found for some points."""
        triangle, nearest = self._on_surface(points[rows])
        # A point that a walk did not reach round a notch may be inside behind the nearest triangle.
        again, behind = self._walk(points[rows], self._tet[triangle])
        is_in = behind.min(axis=1) >= INSIDE
        tet[rows] = np.where(is_in, again, self._tet[triangle])
        beside = self._shares(nearest, self._tet[triangle])
        shares[rows] = np.where(is_in[:, None], behind, beside)

    def _shares(self, points: FloatArray, tet: Ints) -> FloatArray:
        return shares_by(self._inverses[tet], points - self._corners[tet, 0])

    def _walk(self, points: FloatArray, start: Ints) -> tuple[Ints, FloatArray]:
        """Through the face that a point is farthest beyond, until it is reached or there is no neighbour."""
        tet = start.copy()
        shares = self._shares(points, tet)
        going = np.arange(len(points))
        for _ in range(STEPS):
            least = shares[going].argmin(axis=1)
            following = self._neighbours[tet[going], least]
            goes = (shares[going, least] < INSIDE) & (following >= 0)
            going = going[goes]
            if len(going) == 0:
                break
            tet[going] = following[goes]
            shares[going] = self._shares(points[going], tet[going])
        return tet, shares

    def _on_surface(self, points: FloatArray) -> tuple[Ints, FloatArray]:
        """Nearest triangle of the surface, (k,), and the nearest point on it, (k, 3)."""
        triangle, nearest = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
        point, candidate = self._on_triangles.near(points)
        is_sure = np.zeros(len(points), dtype=np.bool_)
        if len(point):
            found, best, at = self._nearest_of(points, point, candidate)
            triangle[found], nearest[found] = best, at
            is_sure[found] = np.linalg.norm(at - points[found], axis=1) <= self._on_triangles.sure
        rest = np.flatnonzero(~is_sure)
        rows = max(1, CHUNK // len(self._triangles))
        for start in range(0, len(rest), rows):
            few = rest[start : start + rows]
            every = np.arange(len(self._triangles))
            pairs = np.repeat(few, len(every)), np.tile(every, len(few))
            found, best, at = self._nearest_of(points, *pairs)
            triangle[found], nearest[found] = best, at
        return triangle, nearest

    def _nearest_of(self, points: FloatArray, point: Ints, triangle: Ints) -> tuple[Ints, Ints, FloatArray]:
        """Points that occur in pairs with triangles, each one's nearest triangle, and the place on that."""
        away = np.linalg.norm(points[point] - self._on_triangles.middles[triangle], axis=1)
        least = np.full(len(points), np.inf)
        np.minimum.at(least, point, away)  # the middle is on the triangle
        may_be = away - self._on_triangles.radius <= least[point]
        point, triangle = point[may_be], triangle[may_be]
        nearest = nearest_points(points[point], self._triangles[triangle])
        distance2 = ((nearest - points[point]) ** 2).sum(axis=1)
        order = np.lexsort((triangle, distance2, point))
        first = order[np.flatnonzero(np.r_[True, point[order][1:] != point[order][:-1]])]
        return point[first], triangle[first], nearest[first]


class _Bins:
    """Elements by where their middles are."""

    def __init__(self, corners: FloatArray) -> None:
        """Args: corners: of each element, (m, c, 3)."""
        self.middles = corners.mean(axis=1)
        self.radius = float(np.linalg.norm(corners - self.middles[:, None], axis=2).max())
        self.sure = self.radius  # an element as near as that is among those that `near` finds
        self._pitch = 2.0 * self.radius
        self._low = np.floor(self.middles.min(axis=0) / self._pitch) - 1
        self._shape = (np.floor(self.middles.max(axis=0) / self._pitch) - self._low + 2).astype(np.int64)
        bins = self._bins(self.middles)
        self._order = np.argsort(bins, kind="stable")
        self._counts = np.bincount(bins, minlength=int(np.prod(self._shape)))
        self._begins = np.cumsum(self._counts) - self._counts

    def near(self, points: FloatArray) -> tuple[Ints, Ints]:
        """All pairs of a point and an element in its bin or one beside that."""
        places = np.floor(points / self._pitch) - self._low
        is_in = ((places >= 1) & (places < self._shape - 1)).all(axis=1)
        inner, home = np.flatnonzero(is_in), self._bins(points[is_in])
        ny, nz = self._shape[1:]
        steps = np.array([(i * ny + j) * nz + k for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)])
        bins = home[:, None] + steps
        counts = self._counts[bins].ravel()
        point = np.repeat(np.repeat(inner, 27), counts)
        place = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
        return point, self._order[np.repeat(self._begins[bins].ravel(), counts) + place]

    def any_at(self, points: FloatArray) -> Ints:
        """An element in the bin of each point, or the first of all where there is none, (k,)."""
        places = np.floor(points / self._pitch) - self._low
        found = np.zeros(len(points), dtype=np.int64)
        inner = np.flatnonzero(((places >= 0) & (places < self._shape)).all(axis=1))
        bins = self._bins(points[inner])
        held = self._counts[bins] > 0
        found[inner[held]] = self._order[self._begins[bins[held]]]
        return found

    def _bins(self, points: FloatArray) -> Ints:
        places = (np.floor(points / self._pitch) - self._low).astype(np.int64)
        return np.asarray(np.ravel_multi_index(tuple(places.T), tuple(self._shape)))


def _neighbours(tets: NDArray[np.integer]) -> Ints:
    """The tetrahedron beyond each face, (m, 4), -1 where there is none."""
    one, other = shared_faces(tets).T
    neighbours = np.full(4 * len(tets), -1)
    neighbours[one], neighbours[other] = other // 4, one // 4
    return neighbours.reshape(-1, 4)


def nearest_points(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """On triangles (k, 3, 3), to points (k, 3): (k, 3)."""
    a = triangles[:, 0]
    edges = np.stack([triangles[:, 1] - a, triangles[:, 2] - a], axis=1)
    gram = np.einsum("kix,kjx->kij", edges, edges)
    right = np.einsum("kix,kx->ki", edges, points - a)
    det = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1] ** 2
    safe = np.where(det > 0.0, det, 1.0)
    s = (gram[:, 1, 1] * right[:, 0] - gram[:, 0, 1] * right[:, 1]) / safe
    t = (gram[:, 0, 0] * right[:, 1] - gram[:, 0, 1] * right[:, 0]) / safe
    is_inside = (det > 0.0) & (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    best = a + s[:, None] * edges[:, 0] + t[:, None] * edges[:, 1]
    least = np.where(is_inside, ((best - points) ** 2).sum(axis=1), np.inf)
    for i in range(3):
        start, way = triangles[:, i], triangles[:, (i + 1) % 3] - triangles[:, i]
        length2 = np.maximum((way**2).sum(axis=1), 1e-300)
        part = np.clip(np.einsum("kx,kx->k", points - start, way) / length2, 0.0, 1.0)
        on_side = start + part[:, None] * way
        distance2 = ((on_side - points) ** 2).sum(axis=1)
        nearer = distance2 < least
        best[nearer], least = on_side[nearer], np.minimum(least, distance2)
    return np.asarray(best)
