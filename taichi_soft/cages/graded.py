"""A body-centred lattice whose cubes are halved at thin parts of the solid.

If two cubes share a face or an edge, they are equal, or one cube is twice as long as the other. Vertices are
the corners and centres of cubes. Between two equal cubes, a tetrahedron consists of both centres and an edge
of the shared face, as in the lattice of equal cubes. If this edge has a vertex in its middle, there are two
tetrahedra instead of one. A face between a large cube and four small cubes is divided into eight triangles.
Each triangle forms a tetrahedron with the centre of the large cube, and another with the centre of a small
cube. (Labelle and Shewchuk, "Isosurface stuffing", 2007, section 3.) Dihedral angles are between 45 and 120
degrees.
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
"""Sectors of a face, in the order of `Lattice.tet_at`. A sector is the triangle between the face's centre and
one edge. The first number selects one of the face's two axes: the axis that points to the edge. The second
number is 1 if the edge lies in the positive direction of this axis, otherwise 0."""


class GradedLattice:
    """Lattice with cubes of several sizes and the interface of `Lattice`.

    The number of a tetrahedron does not encode its position.
    """

    def __init__(self, coarse: Lattice, splits: list[Bools]) -> None:
        """Halve cubes of a lattice.

        Args:
            coarse: lattice of equal cubes.
            splits: result of `balanced`, one array for each octave. An array is True for the cubes of the
                previous octave that are halved. The shapes are (nx, ny, nz), (2 nx, 2 ny, 2 nz), and so on.
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
        # Vertices have integer coordinates. A cube of the last octave is two units long.
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
        """Return the number of the tetrahedron that contains each point, (k,).

        The points must lie within the inner cubes.
        """
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
        """Return the lattice vertices of tetrahedra, (k, 4), in an order that makes volumes positive."""
        return np.asarray(self._all[numbers])

    def points_of(self, vertices: Ints) -> FloatArray:
        """Return the positions of lattice vertices, (k, 3) [m]."""
        coordinates = np.stack(np.unravel_index(vertices, self._shape), axis=1)
        return np.asarray(self.origin + self._unit * coordinates)

    def volumes_of(self, numbers: Ints) -> FloatArray:
        """Return the volumes of tetrahedra, (k,) [m^3]."""
        return np.asarray(self._volumes[numbers])

    def octaves_of(self, numbers: Ints) -> Ints:
        """Return the octave of each tetrahedron, (k,).

        A tetrahedron of octave n has edges as long as the edges of cubes that were halved n times.
        """
        return np.asarray(self._level[numbers])

    def _vertex(self, coordinates: Ints) -> Ints:
        return np.asarray(np.ravel_multi_index(tuple(coordinates.T), self._shape))

    def _add(self, corners: list[Ints], level: int) -> Ints:
        """Add tetrahedra and return their numbers, (k,).

        Args:
            corners: integer coordinates of the first, second, third and fourth corners, (k, 3) each.
            level: octave of the tetrahedra.
        """
        numbers = np.arange(len(corners[0])) + self._count
        self._corners.append(np.stack([self._vertex(each) for each in corners], axis=1))
        self._levels.append(np.full(len(numbers), level))
        self._count += len(numbers)
        return numbers

    def _fill_between_equals(self, level: int, axis: int) -> None:
        """Add the tetrahedra around faces between two cubes of the same octave."""
        leaf, size = self._leaves[level], 2 ** (self.octaves - level)
        here, there = _pairs(leaf, leaf, axis)
        low, high = self._numbers[level][tuple(here.T)], self._numbers[level][tuple(there.T)]
        others = ((axis + 1) % 3, (axis + 2) % 3)
        for sector, (which, forwards) in enumerate(SECTORS):
            across, along = others[which], others[1 - which]
            start = there.copy()  # lower end of the edge, counted in cubes
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
        """True for edges with a vertex in the middle, (k,).

        An edge has a vertex in the middle if one of the four cubes around it is halved.
        Args:
            level: octave of the edges.
            start: lower end of each edge, in cubes of this octave, (k, 3).
            along: axis of the edges.
        """
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
        """Add the tetrahedra on both sides of faces between a large cube and four cubes of half its length.

        The small cubes lie in the positive direction of the axis if `side` is 1, otherwise in the negative
        direction.
        """
        size = 2 ** (self.octaves - level)
        pairs = _pairs(self._leaves[level], self._splits[level], axis)
        large, parent = pairs if side else _pairs(self._splits[level], self._leaves[level], axis)[::-1]
        others = ((axis + 1) % 3, (axis + 2) % 3)
        large_number = self._numbers[level][tuple(large.T)]
        middle = size * (2 * large + 1)
        middle[:, axis] += size if side else -size  # centre of the face
        for directions in ((0, 0), (0, 1), (1, 0), (1, 1)):  # from the face's centre to each small cube
            small = 2 * parent
            small[:, axis] += 1 - side
            opposite = middle.copy()
            for other, direction in zip(others, directions, strict=True):
                small[:, other] += direction
                opposite[:, other] += size if direction else -size
            number = self._numbers[level + 1][tuple(small.T)]
            for which in (0, 1):  # axis from the face's centre to the triangle's corner
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
    """Find neighbours along an axis, with the first cube in `low` and the second cube in `high`.

    Returns: the first cubes and the second cubes, (k, 3) each.
    """
    ahead = np.moveaxis(high, axis, 0)[1:]
    both = np.moveaxis(np.moveaxis(low, axis, 0)[:-1] & ahead, 0, axis)
    here = np.argwhere(both)
    there = here.copy()
    there[:, axis] += 1
    return here, there


def doubled(cubes: NDArray[Kind], octaves: int = 1) -> NDArray[Kind]:
    """Return the values of cubes after `octaves` halvings. Small cubes get the value of the original cube."""
    for axis in range(3):
        cubes = cubes.repeat(2**octaves, axis=axis)
    return cubes


def halved(cubes: Bools) -> Bools:
    """True for cubes of twice the length that contain at least one True entry of `cubes`."""
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
    """Return `splits` with additional halved cubes, so that touching cubes differ by at most one octave."""
    found = list(splits)
    for octave in range(len(found) - 1, 0, -1):
        found[octave - 1] = found[octave - 1] | halved(around(found[octave]))
    return found
