"""Select the tetrahedra of a lattice that cover a solid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import components
from taichi_soft.cages.graded import GradedLattice
from taichi_soft.cages.lattice import Lattice
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.topology import shared_faces

Ints = NDArray[np.int64]

MIN_FILL = 0.4
"""A tetrahedron is selected if at least this fraction of it is solid. The value is below one half because
vertices move inwards more easily than outwards."""

TRACE = 0.02
"""Smallest solid fraction at which a tetrahedron is selected at a limb or sheet that is thinner than a cube.
With the limit `MIN_FILL`, the cage would miss such limbs and sheets."""

LAYER = 2
"""A layer of tetrahedra is thin if each of its tetrahedra is at most this many steps, across faces, away from
a tetrahedron outside the layer."""

MAX_FRAGMENT = 2
"""Fragments of at most this number of tetrahedra are dropped."""

ROUNDS = 3
"""Largest number of rounds in which `mark` adds tetrahedra at hinges, and in which `without_flat` restores
flat tetrahedra. Hinges are vertices at which tetrahedra are connected only by an edge or by the vertex."""


def mark(
    lattice: Lattice | GradedLattice,
    points: FloatArray,
    volumes: FloatArray,
    kept: NDArray[np.bool_] | None = None,
) -> Ints:
    """Select the tetrahedra that cover a solid. Returns: numbers of these tetrahedra, ascending.

    Args:
        points: points that represent one connected solid, (k, 3) [m].
        volumes: volume that each point represents, (k,) [m^3].
        kept: True for points that must be covered even if the solid is very thin, (k,).
    """
    at = lattice.tet_at(points)
    numbers, place = np.unique(at, return_inverse=True)
    fill = np.bincount(place.reshape(-1), volumes) / lattice.volumes_of(numbers)
    trace = min(TRACE, 0.5 * float(fill.max()))
    if kept is not None:
        fill[place.reshape(-1)[kept]] = np.maximum(fill[place.reshape(-1)[kept]], trace)
    corners = lattice.corners_of(numbers)
    selected = fill >= MIN_FILL
    while True:
        missed = ~selected & (fill >= trace) & ~np.isin(corners, corners[selected]).any(axis=1)
        if not missed.any():
            break
        # Select the fullest of adjacent tetrahedra first. Its neighbours are then no longer missed.
        selected |= missed & (fill >= 0.5 * _max_around(corners, np.where(missed, fill, 0.0)))
    if part_count(corners[selected]) > 1:
        selected |= fill >= trace
    for _ in range(ROUNDS):
        hinges = _hinges(corners[selected])
        added = ~selected & (fill >= trace) & np.isin(corners, hinges).any(axis=1)
        if not added.any():
            break
        selected |= added
    if part_count(corners[selected]) > 1:
        selected |= fill > 0.0
    return _bridged(lattice, numbers[selected])


def _bridged(lattice: Lattice | GradedLattice, numbers: Ints) -> Ints:
    """Add empty tetrahedra between parts that touch only at edges or vertices.

    Returns: numbers of all tetrahedra, ascending. Faces then connect all parts that touch.
    """
    others, every = np.zeros(0, dtype=np.int64), np.zeros((0, 4), dtype=np.int64)
    while True:
        tets = lattice.corners_of(numbers)
        parts = components(len(tets), face_pairs(tets))
        ends = np.unique(np.stack([tets.ravel(), np.repeat(parts, 4)], axis=1), axis=0)
        vertices, counts = np.unique(ends[:, 0], return_counts=True)
        if (counts == 1).all():
            return numbers
        if len(every) == 0:
            others = np.setdiff1d(lattice.tets, numbers)
            every = lattice.corners_of(others)
        # The tetrahedra that touch the most vertices shared by several parts close the most gaps.
        meets = np.isin(every, vertices[counts > 1]).sum(axis=1)
        meets[np.isin(others, numbers)] = 0
        if not meets.any():
            return numbers
        numbers = np.union1d(numbers, others[meets == meets.max()])


def part_count(tets: Ints) -> int:
    """Return the number of parts. Tetrahedra that share a face belong to the same part."""
    return int(components(len(tets), face_pairs(tets)).max(initial=-1)) + 1


def _max_around(corners: Ints, fill: FloatArray) -> FloatArray:
    """Return for each tetrahedron the largest fill of all tetrahedra that share a vertex with it, (m,)."""
    used, local = np.unique(corners, return_inverse=True)
    largest = np.zeros(len(used))
    local = local.reshape(-1, 4)
    np.maximum.at(largest, local.ravel(), np.repeat(fill, 4))
    return np.asarray(largest[local].max(axis=1))


def face_pairs(tets: Ints) -> Ints:
    """Return the pairs of tetrahedra that share a face, (k, 2)."""
    return shared_faces(tets) // 4


def _fans(tets: Ints) -> Ints:
    """Return the number of the fan to which each corner of each tetrahedron belongs, (m, 4).

    Two corners at the same vertex belong to the same fan if faces at this vertex connect their tetrahedra.
    """
    one, other = (shared_faces(tets) // 4).T
    pairs = []
    for k in range(4):
        for j in range(4):
            meets = tets[one, k] == tets[other, j]
            pairs.append(np.stack([4 * one[meets] + k, 4 * other[meets] + j], axis=1))
    return components(4 * len(tets), np.concatenate(pairs)).reshape(-1, 4)


def _hinges(tets: Ints) -> Ints:
    """Return the vertices at which tetrahedra are connected only by an edge or by the vertex itself, (k,)."""
    fans = np.unique(np.stack([tets.ravel(), _fans(tets).ravel()], axis=1), axis=0)
    vertices, counts = np.unique(fans[:, 0], return_counts=True)
    return vertices[counts > 1]


def split_hinges(tets: Ints) -> tuple[Ints, Ints]:
    """Split hinges: give each fan of tetrahedra around a vertex its own vertex.

    Returns: new tetrahedra, (m, 4), and the old number of each new vertex, (n,).
    """
    fans = _fans(tets)
    numbers, first = np.unique(fans, return_index=True)
    return np.searchsorted(numbers, fans), tets.ravel()[first]


def without_flat(tets: Ints, flat: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Remove flat tetrahedra in thin layers, but keep the rest connected.

    Returns: True for tetrahedra that stay, (m,).
    Small fragments that would fall off are removed too. If a larger fragment would fall off, the tetrahedra
    around it stay.
    """
    removed = _in_a_layer(tets, flat)
    pairs = face_pairs(tets)
    for _ in range(ROUNDS):
        kept = ~removed
        parts = components(len(tets), pairs[kept[pairs].all(axis=1)])
        sizes = np.bincount(parts[kept], minlength=len(tets))
        is_main = parts == sizes.argmax()
        is_fragment = kept & ~is_main & (sizes[parts] <= MAX_FRAGMENT)
        torn = kept & ~is_fragment & ~is_main
        if not torn.any():
            return np.asarray(kept & ~is_fragment)
        removed &= ~np.isin(tets, tets[torn]).any(axis=1)
    return np.ones(len(tets), dtype=np.bool_)


def _in_a_layer(tets: Ints, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """True for the chosen tetrahedra that lie in a thin layer, (m,).

    A group of chosen tetrahedra that faces connect is a thin layer if each of them is at most `LAYER` steps
    from a tetrahedron that is not chosen. A thin limb whose tetrahedra are all chosen is not a layer.
    """
    pairs = face_pairs(tets)
    groups = components(len(tets), pairs[chosen[pairs].all(axis=1)])
    has_other = np.zeros(len(tets), dtype=np.bool_)
    mixed = pairs[chosen[pairs[:, 0]] != chosen[pairs[:, 1]]]
    has_other[mixed.ravel()] = True
    for _ in range(LAYER - 1):
        has_other[pairs[has_other[pairs].any(axis=1)].ravel()] = True
    deep = np.zeros(len(tets), dtype=np.bool_)
    deep[groups[chosen & ~has_other]] = True
    return np.asarray(chosen & ~deep[groups])
