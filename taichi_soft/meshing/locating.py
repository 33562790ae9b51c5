"""Find the tetrahedron of a mesh that contains a point or is nearest to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.math.barycentric import edge_inverses, shares_by
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.tet_mesh import TetMesh
from taichi_soft.meshing.topology import LOCAL_FACES, shared_faces

Ints = NDArray[np.int64]

MAX_STEPS = 64
"""Largest number of steps of a walk towards a point. If a walk needs more steps, the surface is searched
instead."""

INSIDE = -1e-9
"""A point counts as inside a tetrahedron if no barycentric coordinate is below this value. The value is
slightly negative to allow for rounding."""

CHUNK = 1 << 20
"""Number of pairs of points and elements that are processed at once."""

BATCH = 1 << 13
"""Number of points that are processed at once."""


class Locator:
    """Search for the tetrahedra of a mesh at rest that contain points or are nearest to them."""

    def __init__(self, mesh: TetMesh) -> None:
        """Find the neighbours of the tetrahedra, and sort tetrahedra and surface triangles into bins."""
        self._corners = mesh.vertices[mesh.tets]
        self._inverses = edge_inverses(self._corners)
        self._neighbours = _neighbours(mesh.tets)
        self._tet, self._face = np.nonzero(self._neighbours < 0)
        self._triangles = self._corners[self._tet[:, None], LOCAL_FACES[self._face]]
        self._on_tets, self._on_triangles = _Bins(self._corners), _Bins(self._triangles)

    def __call__(self, points: FloatArray, start: Ints | None = None) -> tuple[Ints, FloatArray]:
        """Locate points (k, 3).

        Args: start: tetrahedron at which the walk to each point starts, (k,), -1 if none is known.
        Returns: the tetrahedron that contains each point or is nearest to the point, (k,); and the
            barycentric coordinates of the nearest point in that tetrahedron, (k, 4), 0 or more.
        """
        tet = np.full(len(points), -1) if start is None else start.copy()
        unknown = tet < 0
        tet[unknown] = self._on_tets.any_element(points[unknown])
        tet, weights = self._walk(points, tet)
        outside = np.flatnonzero(weights.min(axis=1) < INSIDE)
        for first in range(0, len(outside), BATCH):
            self._find_outside(points, outside[first : first + BATCH], tet, weights)
        weights = np.maximum(weights, 0.0)
        return tet, weights / weights.sum(axis=1, keepdims=True)

    def _find_outside(self, points: FloatArray, rows: Ints, tet: Ints, weights: FloatArray) -> None:
        """Replace the results of walks to points outside the mesh by the nearest points of the mesh."""
        triangle, nearest = self._on_surface(points[rows])
        # A walk can end at a notch although the point is inside. Walk again, from the nearest triangle.
        retried_tet, retried_weights = self._walk(points[rows], self._tet[triangle])
        is_in = retried_weights.min(axis=1) >= INSIDE
        tet[rows] = np.where(is_in, retried_tet, self._tet[triangle])
        surface_weights = self._weights(nearest, self._tet[triangle])
        weights[rows] = np.where(is_in[:, None], retried_weights, surface_weights)

    def _weights(self, points: FloatArray, tet: Ints) -> FloatArray:
        return shares_by(self._inverses[tet], points - self._corners[tet, 0])

    def _walk(self, points: FloatArray, start: Ints) -> tuple[Ints, FloatArray]:
        """Walk from tetrahedron to tetrahedron towards each point, as far as the mesh extends.

        Each step crosses the face beyond which the point lies farthest.
        Returns: the last tetrahedron of each walk, (k,), and the barycentric coordinates of the point in this
            tetrahedron, (k, 4).
        """
        tet = start.copy()
        weights = self._weights(points, tet)
        active = np.arange(len(points))
        for _ in range(MAX_STEPS):
            face = weights[active].argmin(axis=1)
            next_tet = self._neighbours[tet[active], face]
            continues = (weights[active, face] < INSIDE) & (next_tet >= 0)
            active = active[continues]
            if len(active) == 0:
                break
            tet[active] = next_tet[continues]
            weights[active] = self._weights(points[active], tet[active])
        return tet, weights

    def _on_surface(self, points: FloatArray) -> tuple[Ints, FloatArray]:
        """Return the nearest triangle of the surface, (k,), and the nearest point on the triangle, (k, 3)."""
        triangle, nearest = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
        point, candidate = self._on_triangles.candidates(points)
        is_final = np.zeros(len(points), dtype=np.bool_)
        if len(point):
            found, best, place = self._nearest_of(points, point, candidate)
            triangle[found], nearest[found] = best, place
            is_final[found] = np.linalg.norm(place - points[found], axis=1) <= self._on_triangles.search_range
        rest = np.flatnonzero(~is_final)
        rows = max(1, CHUNK // len(self._triangles))
        for start in range(0, len(rest), rows):
            batch = rest[start : start + rows]
            every = np.arange(len(self._triangles))
            pairs = np.repeat(batch, len(every)), np.tile(every, len(batch))
            found, best, place = self._nearest_of(points, *pairs)
            triangle[found], nearest[found] = best, place
        return triangle, nearest

    def _nearest_of(self, points: FloatArray, point: Ints, triangle: Ints) -> tuple[Ints, Ints, FloatArray]:
        """Find the nearest triangle of each point among pairs of a point and a triangle.

        Returns: the points that occur in the pairs, (j,), their nearest triangles, (j,), and the nearest
            points on these triangles, (j, 3).
        """
        distance = np.linalg.norm(points[point] - self._on_triangles.centroids[triangle], axis=1)
        bound = np.full(len(points), np.inf)
        np.minimum.at(bound, point, distance)  # an upper bound, because the centroid is on the triangle
        is_candidate = distance - self._on_triangles.radius <= bound[point]
        point, triangle = point[is_candidate], triangle[is_candidate]
        nearest = nearest_points(points[point], self._triangles[triangle])
        distance2 = ((nearest - points[point]) ** 2).sum(axis=1)
        order = np.lexsort((triangle, distance2, point))
        first = order[np.flatnonzero(np.r_[True, point[order][1:] != point[order][:-1]])]
        return point[first], triangle[first], nearest[first]


class _Bins:
    """Elements sorted into bins by their centroids."""

    def __init__(self, corners: FloatArray) -> None:
        """Sort elements into bins. Args: corners: corners of each element, (m, c, 3)."""
        self.centroids = corners.mean(axis=1)
        self.radius = float(np.linalg.norm(corners - self.centroids[:, None], axis=2).max())
        self.search_range = self.radius  # `candidates` finds all elements within this distance
        self._pitch = 2.0 * self.radius
        self._low = np.floor(self.centroids.min(axis=0) / self._pitch) - 1
        self._shape = (np.floor(self.centroids.max(axis=0) / self._pitch) - self._low + 2).astype(np.int64)
        bins = self._bins(self.centroids)
        self._order = np.argsort(bins, kind="stable")
        self._counts = np.bincount(bins, minlength=int(np.prod(self._shape)))
        self._begins = np.cumsum(self._counts) - self._counts

    def candidates(self, points: FloatArray) -> tuple[Ints, Ints]:
        """Return all pairs of a point and an element in the point's bin or an adjacent bin, (k,) each."""
        places = np.floor(points / self._pitch) - self._low
        is_in = ((places >= 1) & (places < self._shape - 1)).all(axis=1)
        inner, own_bin = np.flatnonzero(is_in), self._bins(points[is_in])
        ny, nz = self._shape[1:]
        steps = np.array([(i * ny + j) * nz + k for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)])
        bins = own_bin[:, None] + steps
        counts = self._counts[bins].ravel()
        point = np.repeat(np.repeat(inner, 27), counts)
        place = np.arange(len(point)) - np.repeat(np.cumsum(counts) - counts, counts)
        return point, self._order[np.repeat(self._begins[bins].ravel(), counts) + place]

    def any_element(self, points: FloatArray) -> Ints:
        """Return one element in the bin of each point, (k,), or element 0 if the bin is empty."""
        places = np.floor(points / self._pitch) - self._low
        found = np.zeros(len(points), dtype=np.int64)
        inner = np.flatnonzero(((places >= 0) & (places < self._shape)).all(axis=1))
        bins = self._bins(points[inner])
        is_filled = self._counts[bins] > 0
        found[inner[is_filled]] = self._order[self._begins[bins[is_filled]]]
        return found

    def _bins(self, points: FloatArray) -> Ints:
        places = (np.floor(points / self._pitch) - self._low).astype(np.int64)
        return np.asarray(np.ravel_multi_index(tuple(places.T), tuple(self._shape)))


def _neighbours(tets: NDArray[np.integer]) -> Ints:
    """Return the tetrahedron on the other side of each face, (m, 4), or -1 if there is none."""
    one, other = shared_faces(tets).T
    neighbours = np.full(4 * len(tets), -1)
    neighbours[one], neighbours[other] = other // 4, one // 4
    return neighbours.reshape(-1, 4)


def nearest_points(points: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return the point of each triangle that is nearest to the point in the same row, (k, 3).

    Args:
        points: (k, 3).
        triangles: corners, (k, 3, 3).
    """
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
        start, side = triangles[:, i], triangles[:, (i + 1) % 3] - triangles[:, i]
        length2 = np.maximum((side**2).sum(axis=1), 1e-300)
        fraction = np.clip(np.einsum("kx,kx->k", points - start, side) / length2, 0.0, 1.0)
        on_side = start + fraction[:, None] * side
        distance2 = ((on_side - points) ** 2).sum(axis=1)
        nearer = distance2 < least
        best[nearer], least = on_side[nearer], np.minimum(least, distance2)
    return np.asarray(best)
