"""Which tetrahedra of the lattice carry a solid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.connected import components
from taichi_soft.cages.graded import GradedLattice
from taichi_soft.cages.lattice import Lattice
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.topology import shared_faces

Ints = NDArray[np.int64]

HALF = 0.4
"""Part of a tetrahedron within the solid from which on it is taken: a little more is taken than is left out,
as a vertex is more easily moved inwards."""

TRACE = 0.02
"""The same, where the solid would be lost otherwise: limbs and sheets thinner than a cube."""

LAYER = 2
"""Tetrahedra, face by face, that a flat layer has at most."""

CRUMB = 2
"""Tetrahedra that may fall off."""

ROUNDS = 3
"""In which tetrahedra are added where others hang together at an edge or a vertex only."""


def mark(
    lattice: Lattice | GradedLattice,
    points: FloatArray,
    volumes: FloatArray,
    kept: NDArray[np.bool_] | None = None,
) -> Ints:
    """Numbers of the tetrahedra to take, ascending.

    Args:
        points: that stand for one connected solid, (k, 3) [m].
        volumes: of each, (k,) [m^3].
        kept: those that are not to be lost, however thin the solid is there, (k,).
    """
    at = lattice.tet_at(points)
    numbers, place = np.unique(at, return_inverse=True)
    share = np.bincount(place.reshape(-1), volumes) / lattice.volumes_of(numbers)
    trace = min(TRACE, 0.5 * float(share.max()))
    if kept is not None:
        share[place.reshape(-1)[kept]] = np.maximum(share[place.reshape(-1)[kept]], trace)
    corners = lattice.corners_of(numbers)
    taken = share >= HALF
    while True:
        lost = ~taken & (share >= trace) & ~np.isin(corners, corners[taken]).any(axis=1)
        if not lost.any():
            break
        # The fullest of those that touch come first; what they cover is lost no longer.
        taken |= lost & (share >= 0.5 * _most_around(corners, np.where(lost, share, 0.0)))
    if part_count(corners[taken]) > 1:
        taken |= share >= trace
    for _ in range(ROUNDS):
        loose = _hinges(corners[taken])
        added = ~taken & (share >= trace) & np.isin(corners, loose).any(axis=1)
        if not added.any():
            break
        taken |= added
    if part_count(corners[taken]) > 1:
        taken |= share > 0.0
    return _bridged(lattice, numbers[taken])


def _bridged(lattice: Lattice | GradedLattice, numbers: Ints) -> Ints:
    """With tetrahedra that hold nothing, where parts meet at edges or vertices only: all in one part then,
    unless parts do not meet at all."""
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
        # Those that touch most of the places where parts meet close the most gaps.
        meets = np.isin(every, vertices[counts > 1]).sum(axis=1)
        meets[np.isin(others, numbers)] = 0
        if not meets.any():
            return numbers
        numbers = np.union1d(numbers, others[meets == meets.max()])


def part_count(tets: Ints) -> int:
    """How many parts hang together by faces."""
    return int(components(len(tets), face_pairs(tets)).max(initial=-1)) + 1


def _most_around(corners: Ints, share: FloatArray) -> FloatArray:
    """The largest share of all tetrahedra that have a corner of each, (m,)."""
    used, local = np.unique(corners, return_inverse=True)
    most = np.zeros(len(used))
    local = local.reshape(-1, 4)
    np.maximum.at(most, local.ravel(), np.repeat(share, 4))
    return np.asarray(most[local].max(axis=1))


def face_pairs(tets: Ints) -> Ints:
    """Tetrahedra that share a face, (k, 2)."""
    return shared_faces(tets) // 4


def _fans(tets: Ints) -> Ints:
    """A number for each corner, (m, 4), alike for corners at the same vertex whose tetrahedra hang together
    by faces at that vertex."""
    one, other = (shared_faces(tets) // 4).T
    pairs = []
    for k in range(4):
        for j in range(4):
            meets = tets[one, k] == tets[other, j]
            pairs.append(np.stack([4 * one[meets] + k, 4 * other[meets] + j], axis=1))
    return components(4 * len(tets), np.concatenate(pairs)).reshape(-1, 4)


def _hinges(tets: Ints) -> Ints:
    """Vertices about which tetrahedra hang together at an edge or at the vertex only."""
    fans = np.unique(np.stack([tets.ravel(), _fans(tets).ravel()], axis=1), axis=0)
    vertices, counts = np.unique(fans[:, 0], return_counts=True)
    return vertices[counts > 1]


def split_hinges(tets: Ints) -> tuple[Ints, Ints]:
    """One vertex for each fan: tetrahedra (m, 4) in new numbers, and the old number of each, (n,)."""
    fans = _fans(tets)
    numbers, first = np.unique(fans, return_index=True)
    return np.searchsorted(numbers, fans), tets.ravel()[first]


def without_flat(tets: Ints, flat: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What is left of tetrahedra when flat ones are taken off in a thin layer, (m,), all in one part.

    A crumb that falls off goes with them; where more would, those round it stay.
    """
    taken_off = _in_a_layer(tets, flat)
    pairs = face_pairs(tets)
    for _ in range(ROUNDS):
        kept = ~taken_off
        parts = components(len(tets), pairs[kept[pairs].all(axis=1)])
        sizes = np.bincount(parts[kept], minlength=len(tets))
        is_main = parts == sizes.argmax()
        is_crumb = kept & ~is_main & (sizes[parts] <= CRUMB)
        torn = kept & ~is_crumb & ~is_main
        if not torn.any():
            return np.asarray(kept & ~is_crumb)
        taken_off &= ~np.isin(tets, tets[torn]).any(axis=1)
    return np.ones(len(tets), dtype=np.bool_)


def _in_a_layer(tets: Ints, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Those of the chosen tetrahedra that lie in a thin layer, (m,).

    In each of their groups that hangs together by faces, every one is at most `LAYER` steps from one that was
    not chosen. A thin limb is no such group.
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
