"""Vertices of a cage moved onto the surface of its solid, as far as every tetrahedron stays good."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.solid import Solid
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.topology import LOCAL_EDGES, LOCAL_FACES, surface_of

Ints = NDArray[np.int64]

PASSES = 8
HALVINGS = 5
"""Of a move that would spoil a tetrahedron, before it is given up for this pass."""

SHARPEST, FLATTEST = 20.0, 145.0
"""Dihedral angles that are kept [degrees]."""

STIFFEST = 3.0
"""Largest sum of squared gradients of a tetrahedron's shape functions, over that of the lattice's: were
vertices as heavy as there, the stable step would stay above 0.58 of the lattice's."""

FLAT = 0.25
"""Part of its volume that the surface leaves of a tetrahedron, below which it is in the way of the fit."""

NEAR = (2.83, 6.0, 12.0)
"""How far the middles of voxels are from that of a vertex's own, in voxels, which are looked at first, then
next, ...: a point that is found in one of them, and is nearer by the diagonal of a voxel, is the nearest."""

CHUNK = 1 << 20
"""Pairs of vertices and voxels that are looked at together."""

REACH = 0.75
"""How far from a vertex its surface is looked for, in cubes."""


def fit(vertices: FloatArray, tets: Ints, octaves: Ints, solid: Solid, edge: float) -> FloatArray:
    """New places of the vertices, (n, 3) [m].

    Args:
        vertices: of the lattice, (n, 3) [m].
        tets: (m, 4).
        octaves: how often the lattice's cubes are halved at each tetrahedron, (m,).
        solid: whose surface is sought.
        edge: of the lattice's largest cubes [m].
    """
    surface = surface_of(tets.astype(np.int32))
    is_outer = np.zeros(len(vertices), dtype=np.bool_)
    is_outer[surface] = True
    outer = np.flatnonzero(is_outer)
    inner_mean = _Mean(tets[:, LOCAL_EDGES].reshape(-1, 2), len(vertices))
    outer_mean = _Mean(surface[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), len(vertices))
    nearest = _Nearest(solid, REACH * edge)
    finer = 4.0**octaves
    limit = np.asarray(STIFFEST * float((_stiffness(vertices[tets]) / finer).max()) * finer)
    places = vertices.copy()
    for step in range(PASSES):
        wanted = 0.5 * (places + inner_mean(places))
        wanted[outer] = nearest(places[outer] + (0.5 * (outer_mean(places) - places)[outer] if step else 0.0))
        places = _moved(places, wanted, tets, limit)
    return np.asarray(places)


def caps(vertices: FloatArray, tets: Ints, solid: Solid, edge: float) -> NDArray[np.bool_]:
    """Tetrahedra that the surface would cut flat, (m,): all their vertices are outer ones, and little is left
    of them once these lie on it. Arguments as of `fit`."""
    surface = surface_of(tets.astype(np.int32))
    outer = np.unique(surface)
    places = vertices.copy()
    places[outer] = _Nearest(solid, REACH * edge)(places[outer])
    _, before = _gradients(vertices[tets])
    _, after = _gradients(places[tets])
    return np.asarray(np.isin(tets, outer).all(axis=1) & (after < FLAT * before))


def _moved(places: FloatArray, wanted: FloatArray, tets: Ints, limit: FloatArray) -> FloatArray:
    """As far towards `wanted` as all tetrahedra stay good, each vertex by halves."""
    part = np.ones(len(places))
    for halving in range(HALVINGS + 1):
        tried = places + part[:, None] * (wanted - places)
        spoilt = _is_spoilt(tried[tets], limit)
        if not spoilt.any():
            return tried
        part[tets[spoilt]] *= 0.5 if halving < HALVINGS - 1 else 0.0
    while spoilt.any():  # until all round is where it was, which was good
        part[tets[spoilt]] = 0.0
        tried = places + part[:, None] * (wanted - places)
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
    """Of the shape functions, (m, 4, 3) [1/m], and volumes, (m,) [m^3]."""
    faces = corners[:, LOCAL_FACES]
    areas = np.cross(faces[:, :, 1] - faces[:, :, 0], faces[:, :, 2] - faces[:, :, 0])
    edges = corners[:, 1:] - corners[:, :1]
    volumes = np.einsum("ij,ij->i", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) / 6.0
    safe = np.where(volumes > 0.0, volumes, np.nan)
    return -areas / (6.0 * safe)[:, None, None], volumes


class _Mean:
    """Of the neighbours of each vertex."""

    def __init__(self, edges: NDArray[np.integer], count: int) -> None:
        pairs = np.unique(np.sort(edges, axis=1), axis=0)
        self._ends = np.concatenate([pairs, pairs[:, ::-1]])
        self._counts = np.maximum(np.bincount(self._ends[:, 0], minlength=count), 1)
        self._count = count

    def __call__(self, places: FloatArray) -> FloatArray:
        sums = [np.bincount(self._ends[:, 0], places[self._ends[:, 1], k], self._count) for k in range(3)]
        return np.stack(sums, axis=1) / self._counts[:, None]


class _Nearest:
    """The nearest point of the surface between inside and outside."""

    def __init__(self, solid: Solid, reach: float) -> None:
        self._solid = solid
        cells = int(np.ceil(reach / solid.spacing))
        offsets = np.argwhere(np.ones((2 * cells + 1,) * 3)) - cells
        squares = (offsets**2).sum(axis=1)
        order = np.argsort(squares, kind="stable")
        squares = squares[order]
        self._offsets = offsets[order[squares <= (cells + 1) ** 2]]
        self._near = [(np.searchsorted(squares, r**2), (r - 3**0.5) * solid.spacing) for r in NEAR]
        points = np.full((*(n + 2 * cells for n in solid.fill.shape), 3), np.nan)
        inner = (slice(cells, -cells),) * 3
        points[inner] = np.where(_is_border(solid.fill)[..., None], solid.surface, np.nan)
        self._points, self._pad = points, cells

    def __call__(self, places: FloatArray) -> FloatArray:
        """Of each of `places` (k, 3) [m]; itself where there is none in reach."""
        found = places.copy()
        away = np.full(len(places), np.inf)
        rest = np.arange(len(places))
        for count, sure in (*self._near, (len(self._offsets), np.inf)):
            offsets = self._offsets[:count]
            rows = max(1, CHUNK // len(offsets))
            for start in range(0, len(rest), rows):
                few = rest[start : start + rows]
                found[few], away[few] = self._among(places[few], offsets)
            rest = rest[~(away[rest] <= sure)]
        return np.asarray(found)

    def _among(self, places: FloatArray, offsets: Ints) -> tuple[FloatArray, FloatArray]:
        """The nearest in the voxels at `offsets` from each place, and how far it is; itself where none is."""
        top = np.array(self._solid.fill.shape) - 1
        voxels = ((places - self._solid.origin) / self._solid.spacing).astype(np.int64)
        near = np.clip(voxels, 0, top)[:, None] + offsets + self._pad
        points = self._points[tuple(np.moveaxis(near, 2, 0))]
        distance = np.linalg.norm(points - places[:, None], axis=2)
        distance[np.isnan(distance)] = np.inf
        rows, best = np.arange(len(places)), distance.argmin(axis=1)
        is_there = np.isfinite(distance[rows, best])
        return np.where(is_there[:, None], points[rows, best], places), distance[rows, best]


def _is_border(fill: FloatArray) -> NDArray[np.bool_]:
    """Voxels that are not full, or beside which one is not."""
    least = np.pad(fill, 1)
    for axis in range(3):
        ahead = [slice(None)] * 3
        ahead[axis] = slice(0, -2)
        middle, behind = ahead.copy(), ahead.copy()
        middle[axis], behind[axis] = slice(1, -1), slice(2, None)
        least = np.minimum(np.minimum(least[tuple(ahead)], least[tuple(middle)]), least[tuple(behind)])
    return np.asarray(least < 0.99)
