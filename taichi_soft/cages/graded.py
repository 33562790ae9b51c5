"""A body-centred lattice whose cubes are halved at thin parts of the solid.

Cubes that share a face or an edge are equal, or one is twice as long as the other. As in the lattice of equal
cubes, the vertices are corners and centres of cubes, and a tetrahedron has the centres of two equal
neighbours and an edge of the face between them. If the edge has a vertex in its middle, there are two
tetrahedra instead. A face between a cube and four small ones consists of eight triangles, each joined to the
centres on both sides. (Labelle and Shewchuk, "Isosurface stuffing", 2007, section 3.) Dihedral angles are
between 45 and 120 degrees.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.lattice import Lattice
from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Kind = TypeVar("Kind", bound=np.generic)

SECTORS = ((0, 1), (0, 0), (1, 1), (1, 0))
"""Sectors of a face, each between its centre and one of its edges: which of the two other axes points to the
edge, and 1 for its positive direction. The order is the one in `Lattice.tet_at`."""


class GradedLattice:
    """A lattice with the interface of `Lattice`. A tetrahedron's number does not encode its position."""

    def __init__(self, coarse: Lattice, splits: list[Bools]) -> None:
        """Halve cubes of a lattice.

        Args:
            coarse: lattice of equal cubes.
            splits: result of `balanced`. For each octave, True for the cubes of the previous octave that are
                halved, first (nx, ny, nz), then (2 nx, 2 ny, 2 nz), and so on.
        """
        self.origin, self.edge = coarse.origin, coarse.edge
        self.octaves = len(splits)
        self._leaves: list[Bools] = []
        self._numbers: list[Ints] = []
        starts = [0]
        exists = np.ones(coarse.cubes, dtype=np.bool_)
        for split in (*splits, None):
            leaf = exists if split is None else exists & ~split
            number = np.full(leaf.shape, -1)
            number[leaf] = np.arange(int(leaf.sum())) + starts[-1]
            self._leaves.append(leaf)
            self._numbers.append(number)
            starts.append(starts[-1] + int(leaf.sum()))
            if split is not None:
                exists = doubled(split)
        self._splits = [*splits, np.zeros(self._leaves[-1].shape, dtype=np.bool_)]
        # Integer coordinates: a cube of the last octave is two units long.
        self._shape = tuple(2 * n + 1 for n in self._leaves[-1].shape)
        self._unit = coarse.edge / 2 ** (self.octaves + 1)
        self._table = np.full((starts[-1], 3, 2, 4, 2), -1)
        self._corners: list[Ints] = []
        self._levels: list[Ints] = []
        self._count = 0
        for level in range(self.octaves + 1):
            for axis in range(3):
                self._fill_between_equals(level, axis)
                if level < self.octaves:
                    for side in (0, 1):
                        self._fill_between_unequals(level, axis, side)
        self._all = np.concatenate(self._corners)
        self._level = np.concatenate(self._levels)
        x = self.points_of(self._all.ravel()).reshape(-1, 4, 3)
        volumes = np.linalg.det(x[:, 1:] - x[:, :1]) / 6.0
        turned = volumes < 0
        self._all[turned] = self._all[turned][:, [0, 1, 3, 2]]
        self._volumes = np.abs(volumes)

    @property
    def tets(self) -> Ints:
        """Numbers of all tetrahedra, ascending."""
        return np.arange(self._count)

    def tet_at(self, points: FloatArray) -> Ints:
        """Number of the tetrahedron that contains each point within the inner cubes, (k,)."""
        found = np.full(len(points), -1)
        for level in range(self.octaves + 1):
            coordinates = (points - self.origin) / (self.edge / 2**level)
            cube = coordinates.astype(np.int64)
            leaf = self._numbers[level][tuple(cube.T)]
            rows = np.flatnonzero(leaf >= 0)
            offset = (coordinates - cube - 0.5)[rows]
            axis = np.argmax(np.abs(offset), axis=1)
            every = np.arange(len(rows))
            u, v = offset[every, (axis + 1) % 3], offset[every, (axis + 2) % 3]
            by_u = np.abs(u) >= np.abs(v)
            sector = np.where(by_u, (u < 0).astype(np.int64), 2 + (v < 0))
            half = (np.where(by_u, v, u) >= 0).astype(np.int64)
            ahead = (offset[every, axis] >= 0).astype(np.int64)
            found[rows] = self._table[leaf[rows], axis, ahead, sector, half]
        return found

    def corners_of(self, numbers: Ints) -> Ints:
        """Lattice vertices of tetrahedra, (k, 4), ordered so that volumes are positive."""
        return np.asarray(self._all[numbers])

    def points_of(self, vertices: Ints) -> FloatArray:
        """Positions of lattice vertices, (k, 3) [m]."""
        coordinates = np.stack(np.unravel_index(vertices, self._shape), axis=1)
        return np.asarray(self.origin + self._unit * coordinates)

    def volumes_of(self, numbers: Ints) -> FloatArray:
        """Volumes of tetrahedra, (k,) [m^3]."""
        return np.asarray(self._volumes[numbers])

    def octaves_of(self, numbers: Ints) -> Ints:
        """Number of halvings of the cubes whose edges are as long as those of the tetrahedra, (k,)."""
        return np.asarray(self._level[numbers])

    def _vertex(self, coordinates: Ints) -> Ints:
        return np.asarray(np.ravel_multi_index(tuple(coordinates.T), self._shape))

    def _add(self, corners: list[Ints], level: int) -> Ints:
        """Add tetrahedra whose corners are given by four lists of coordinates. Returns their numbers."""
        numbers = np.arange(len(corners[0])) + self._count
        self._corners.append(np.stack([self._vertex(each) for each in corners], axis=1))
        self._levels.append(np.full(len(numbers), level))
        self._count += len(numbers)
        return numbers

    def _fill_between_equals(self, level: int, axis: int) -> None:
        """Add the tetrahedra around faces between two cubes of one octave."""
        leaf, size = self._leaves[level], 2 ** (self.octaves - level)
        here, there = _pairs(leaf, leaf, axis)
        low, high = self._numbers[level][tuple(here.T)], self._numbers[level][tuple(there.T)]
        others = ((axis + 1) % 3, (axis + 2) % 3)
        for sector, (which, forwards) in enumerate(SECTORS):
            across, along = others[which], others[1 - which]
            start = there.copy()  # start of the edge, in cubes
            start[:, across] += forwards
            step = np.eye(3, dtype=np.int64)[along] * size
            has_middle = self._has_middle(level, start, along)
            centers = [size * (2 * here + 1), size * (2 * there + 1)]
            begin = 2 * size * start
            undivided, divided = ~has_middle, has_middle
            for rows, ends, halves, octave in (
                (undivided, (begin, begin + 2 * step), (0, 1), level),
                (divided, (begin, begin + step), (0,), level + 1),
                (divided, (begin + step, begin + 2 * step), (1,), level + 1),
            ):
                added = self._add([each[rows] for each in (*centers, *ends)], octave)
                for half in halves:
                    self._table[low[rows], axis, 1, sector, half] = added
                    self._table[high[rows], axis, 0, sector, half] = added

    def _has_middle(self, level: int, start: Ints, along: int) -> Bools:
        """True for each edge, given by its lowest corner, if one of the four cubes around it is halved."""
        split = self._splits[level]
        others = [k for k in range(3) if k != along]
        found = np.zeros(len(start), dtype=np.bool_)
        for one in (0, 1):
            for other in (0, 1):
                cube = start.copy()
                cube[:, others[0]] -= one
                cube[:, others[1]] -= other
                is_in = ((cube >= 0) & (cube < split.shape)).all(axis=1)
                found[is_in] |= split[tuple(cube[is_in].T)]
        return found

    def _fill_between_unequals(self, level: int, axis: int, side: int) -> None:
        """Add the tetrahedra on both sides of faces between a cube and four of half its length.

        The small cubes lie ahead if `side` is 1.
        """
        size = 2 ** (self.octaves - level)
        pairs = _pairs(self._leaves[level], self._splits[level], axis)
        large, parent = pairs if side else _pairs(self._splits[level], self._leaves[level], axis)[::-1]
        others = ((axis + 1) % 3, (axis + 2) % 3)
        large_number = self._numbers[level][tuple(large.T)]
        middle = size * (2 * large + 1)
        middle[:, axis] += size if side else -size  # centre of the face
        for directions in ((0, 0), (0, 1), (1, 0), (1, 1)):  # each small cube, from the centre of the face
            small = 2 * parent
            small[:, axis] += 1 - side
            opposite = middle.copy()
            for other, direction in zip(others, directions, strict=True):
                small[:, other] += direction
                opposite[:, other] += size if direction else -size
            number = self._numbers[level + 1][tuple(small.T)]
            for which in (0, 1):  # axis from the centre to the triangle's corner
                corner = middle.copy()
                corner[:, others[which]] = opposite[:, others[which]]
                triangle = [middle, corner, opposite]
                outer = SECTORS.index((which, directions[which]))
                inner = SECTORS.index((1 - which, 1 - directions[1 - which]))
                added = self._add([size * (2 * large + 1), *triangle], level + 1)
                self._table[large_number, axis, side, outer, directions[1 - which]] = added
                added = self._add([(size // 2) * (2 * small + 1), *triangle], level + 1)
                for sector in (outer, inner):
                    for half in (0, 1):
                        self._table[number, axis, 1 - side, sector, half] = added


def _pairs(low: Bools, high: Bools, axis: int) -> tuple[Ints, Ints]:
    """Neighbours along an axis, the lower one in `low` and the upper one in `high`, (k, 3) each."""
    ahead = np.moveaxis(high, axis, 0)[1:]
    both = np.moveaxis(np.moveaxis(low, axis, 0)[:-1] & ahead, 0, axis)
    here = np.argwhere(both)
    there = here.copy()
    there[:, axis] += 1
    return here, there


def doubled(cubes: NDArray[Kind], octaves: int = 1) -> NDArray[Kind]:
    """Return the values for cubes halved `octaves` times: each part gets the value of its cube."""
    for axis in range(3):
        cubes = cubes.repeat(2**octaves, axis=axis)
    return cubes


def halved(cubes: Bools) -> Bools:
    """True for cubes of twice the length that contain one of `cubes`."""
    nx, ny, nz = (n // 2 for n in cubes.shape)
    return np.asarray(cubes.reshape(nx, 2, ny, 2, nz, 2).any(axis=(1, 3, 5)))


def around(cubes: Bools) -> Bools:
    """Return `cubes` together with all cubes that touch them."""
    for axis in range(3):
        moved = np.moveaxis(cubes.copy(), axis, 0)
        still = np.moveaxis(cubes, axis, 0)
        moved[1:] |= still[:-1]
        moved[:-1] |= still[1:]
        cubes = np.moveaxis(moved, 0, axis)
    return cubes


def balanced(splits: list[Bools]) -> list[Bools]:
    """Return splits with more halved cubes, so that cubes that touch differ by at most one octave."""
    found = list(splits)
    for octave in range(len(found) - 1, 0, -1):
        found[octave - 1] = found[octave - 1] | halved(around(found[octave]))
    return found
