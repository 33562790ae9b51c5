"""Move the vertices of a cage onto the surface of its solid, as far as all tetrahedra stay well shaped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.solid import Solid
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.topology import LOCAL_EDGES, LOCAL_FACES, surface_of

Ints = NDArray[np.int64]

PASSES = 8
HALVINGS = 5
"""A move that makes a tetrahedron invalid is halved. If it is still invalid after this number of attempts,
the move is dropped."""

SHARPEST, FLATTEST = 20.0, 145.0
"""Smallest and largest valid dihedral angle of a tetrahedron [degrees]."""

MAX_STIFFNESS = 3.0
"""Largest sum of squared gradients of a tetrahedron's shape functions, as a multiple of the same sum in the
lattice. With the masses that vertices have in the lattice, this limit keeps the stable step above 0.58 of the
lattice's stable step."""

FLAT = 0.25
"""A tetrahedron is removed if moving its vertices onto the surface leaves less than this fraction of its
volume."""

SEARCH_RADII = (2.83, 6.0, 12.0)
"""Radii of successive searches around the voxel of a vertex, in voxels. The search stops as soon as it finds
a point that is no farther away than the radius minus the diagonal of a voxel."""

CHUNK = 1 << 20
"""Number of pairs of a vertex and a voxel that are processed at once."""

SEARCH_RANGE = 0.75
"""Largest distance from a vertex at which surface points are searched, as a fraction of the edge of a
cube."""


def fit(vertices: FloatArray, tets: Ints, octaves: Ints, solid: Solid, edge: float) -> FloatArray:
    """Move vertices onto the surface of a solid. Returns: new positions, (n, 3) [m].

    Args:
        vertices: vertices of the lattice, (n, 3) [m].
        tets: vertex indices of the tetrahedra, (m, 4).
        octaves: number of halvings of the lattice's cubes at each tetrahedron, (m,).
        solid: solid whose surface is fitted.
        edge: edge of the lattice's largest cubes [m].
    """
    surface = surface_of(tets.astype(np.int32))
    is_outer = np.zeros(len(vertices), dtype=np.bool_)
    is_outer[surface] = True
    outer = np.flatnonzero(is_outer)
    inner_mean = _NeighbourMean(tets[:, LOCAL_EDGES].reshape(-1, 2), len(vertices))
    outer_mean = _NeighbourMean(surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), len(vertices))
    nearest = _Nearest(solid, SEARCH_RANGE * edge)
    finer = 4.0**octaves
    limit = np.asarray(MAX_STIFFNESS * float((_stiffness(vertices[tets]) / finer).max()) * finer)
    positions = vertices.copy()
    for step in range(PASSES):
        targets = 0.5 * (positions + inner_mean(positions))
        targets[outer] = nearest(
            positions[outer] + (0.5 * (outer_mean(positions) - positions)[outer] if step else 0.0)
        )
        positions = _moved(positions, targets, tets, limit)
    return np.asarray(positions)


def caps(vertices: FloatArray, tets: Ints, solid: Solid, edge: float) -> NDArray[np.bool_]:
    """True for tetrahedra that the surface would flatten, (m,).

    All vertices of such a tetrahedron are outer vertices. When they lie on the surface, little of the
    tetrahedron's volume is left. The arguments are those of `fit`.
    """
    surface = surface_of(tets.astype(np.int32))
    outer = np.unique(surface)
    positions = vertices.copy()
    positions[outer] = _Nearest(solid, SEARCH_RANGE * edge)(positions[outer])
    _, before = _gradients(vertices[tets])
    _, after = _gradients(positions[tets])
    return np.asarray(np.isin(tets, outer).all(axis=1) & (after < FLAT * before))


def _moved(positions: FloatArray, targets: FloatArray, tets: Ints, limit: FloatArray) -> FloatArray:
    """Move vertices towards `targets` as far as all tetrahedra stay valid.

    A move that makes a tetrahedron invalid is halved several times, then dropped.
    Args: limit: largest sum of squared gradients allowed in each tetrahedron, (m,) [1/m^2].
    Returns: new positions, (n, 3) [m].
    """
    fraction = np.ones(len(positions))
    for halving in range(HALVINGS + 1):
        tried = positions + fraction[:, None] * (targets - positions)
        spoilt = _is_spoilt(tried[tets], limit)
        if not spoilt.any():
            return tried
        fraction[tets[spoilt]] *= 0.5 if halving < HALVINGS - 1 else 0.0
    while spoilt.any():
        fraction[tets[spoilt]] = 0.0
        tried = positions + fraction[:, None] * (targets - positions)
        spoilt = _is_spoilt(tried[tets], limit)
    return tried


def _is_spoilt(corners: FloatArray, limit: FloatArray) -> NDArray[np.bool_]:
    gradients, volumes = _gradients(corners)
    lengths = np.linalg.norm(gradients, axis=2)
    one, other = LOCAL_EDGES.T
    cosine = -np.einsum("tei,tei->te", gradients[:, one], gradients[:, other])
    with np.errstate(invalid="ignore"):
        cosine /= lengths[:, one] * lengths[:, other]
    sharp, flat = np.cos(np.radians([SHARPEST, FLATTEST]))
    is_good = (volumes > 0) & (cosine.max(axis=1) < sharp) & (cosine.min(axis=1) > flat)
    return np.asarray(~(is_good & ((lengths**2).sum(axis=1) < limit)))


def _stiffness(corners: FloatArray) -> FloatArray:
    gradients, _ = _gradients(corners)
    return np.asarray((gradients**2).sum(axis=(1, 2)))


def _gradients(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the gradients of the shape functions, (m, 4, 3) [1/m], and the volumes, (m,) [m^3]."""
    faces = corners[:, LOCAL_FACES]
    areas = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    edges = corners[:, 1:] - corners[:, :1]
    volumes = np.einsum("ij,ij->i", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6.0
    safe = np.where(volumes > 0.0, volumes, np.nan)
    return -areas / (6.0 * safe)[:, None, None], volumes


class _NeighbourMean:
    """Function that maps positions of vertices to the mean position of each vertex's neighbours, (n, 3)."""

    def __init__(self, edges: NDArray[np.integer], count: int) -> None:
        pairs = np.unique(np.sort(edges, axis=1), axis=0)
        self._ends = np.concatenate([pairs, pairs[:, ::-1]])
        self._counts = np.maximum(np.bincount(self._ends[:, 0], minlength=count), 1)
        self._count = count

    def __call__(self, positions: FloatArray) -> FloatArray:
        sums = [np.bincount(self._ends[:, 0], positions[self._ends[:, 1], k], self._count) for k in range(3)]
        return np.stack(sums, axis=1) / self._counts[:, None]


class _Nearest:
    """Search for the nearest point on the surface that separates inside and outside."""

    def __init__(self, solid: Solid, search_range: float) -> None:
        self._solid = solid
        cells = int(np.ceil(search_range / solid.spacing))
        offsets = np.argwhere(np.ones((2 * cells + 1,) * 3)) - cells
        squares = (offsets**2).sum(axis=1)
        order = np.argsort(squares, kind="stable")
        squares = squares[order]
        self._offsets = offsets[order[squares <= (cells + 1) ** 2]]
        self._near = [(np.searchsorted(squares, r**2), (r - 3**0.5) * solid.spacing) for r in SEARCH_RADII]
        points = np.full((*(n + 2 * cells for n in solid.fill.shape), 3), np.nan)
        inner = (slice(cells, -cells),) * 3
        points[inner] = np.where(_is_border(solid.fill)[..., None], solid.surface, np.nan)
        self._points, self._pad = points, cells

    def __call__(self, positions: FloatArray) -> FloatArray:
        """Return the surface point nearest to each of `positions` (k, 3) [m].

        If no surface point is within range, the result is the position itself.
        """
        found = positions.copy()
        distance = np.full(len(positions), np.inf)
        rest = np.arange(len(positions))
        for count, limit in (*self._near, (len(self._offsets), np.inf)):
            offsets = self._offsets[:count]
            rows = max(1, CHUNK // len(offsets))
            for start in range(0, len(rest), rows):
                batch = rest[start : start + rows]
                found[batch], distance[batch] = self._among(positions[batch], offsets)
            rest = rest[~(distance[rest] <= limit)]
        return np.asarray(found)

    def _among(self, positions: FloatArray, offsets: Ints) -> tuple[FloatArray, FloatArray]:
        """Return the nearest point in the voxels at `offsets`, (k, 3) [m], and its distance, (k,) [m].

        If these voxels contain no point, the result is the position itself and an infinite distance.
        """
        last = np.array(self._solid.fill.shape) - 1
        voxels = ((positions - self._solid.origin) / self._solid.spacing).astype(np.int64)
        candidates = np.clip(voxels, 0, last)[:, None] + offsets + self._pad
        points = self._points[tuple(np.moveaxis(candidates, 2, 0))]
        distances = np.linalg.norm(points - positions[:, None], axis=2)
        distances[np.isnan(distances)] = np.inf
        rows, best = np.arange(len(positions)), distances.argmin(axis=1)
        is_found = np.isfinite(distances[rows, best])
        return np.where(is_found[:, None], points[rows, best], positions), distances[rows, best]


def _is_border(fill: FloatArray) -> NDArray[np.bool_]:
    """True for voxels that are not full or have a neighbour that is not full."""
    least = np.pad(fill, 1)
    for axis in range(3):
        ahead = [slice(None)] * 3
        ahead[axis] = slice(0, -2)
        middle, behind = ahead.copy(), ahead.copy()
        middle[axis], behind[axis] = slice(1, -1), slice(2, None)
        least = np.minimum(np.minimum(least[tuple(ahead)], least[tuple(middle)]), least[tuple(behind)])
    return np.asarray(least < 0.99)
