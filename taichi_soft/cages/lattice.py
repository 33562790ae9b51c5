"""The body-centred cubic lattice: equal tetrahedra without a preferred direction.

The vertices of the lattice are corners and centres of cubes. Each tetrahedron consists of the centres of two
neighbouring cubes and an edge of the face between them. Dihedral angles are 60 and 90 degrees, and there are
twelve tetrahedra per cube. (Labelle and Shewchuk, "Isosurface stuffing", 2007. That method cuts the lattice
at the surface; `fitting` moves the vertices instead.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing.arrays import FloatArray

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lattice:
    """Cubes around a solid, with one more layer on each side.

    The number of a tetrahedron encodes the tetrahedron's position.
    """

    origin: FloatArray  # (3,), corner of the first cube [m]
    edge: float  # edge of a cube [m]
    cubes: tuple[int, int, int]

    @classmethod
    def around_box(cls, low: FloatArray, high: FloatArray, edge: float) -> Lattice:
        """Make a lattice that is centred on the box between `low` and `high` [m]."""
        inner = np.maximum(np.ceil((high - low) / edge - 1e-9).astype(np.int64), 1)
        origin = 0.5 * (low + high) - 0.5 * edge * inner - edge
        nx, ny, nz = (int(n) + 2 for n in inner)
        return cls(origin, edge, (nx, ny, nz))

    def volumes_of(self, numbers: Ints) -> FloatArray:
        """Return the volumes of tetrahedra, (k,) [m^3]. All volumes are equal."""
        return np.full(len(numbers), self.edge**3 / 12.0)

    def octaves_of(self, numbers: Ints) -> Ints:
        """Return the octave of each tetrahedron, (k,). All octaves are 0, because no cube is halved."""
        return np.zeros(len(numbers), dtype=np.int64)

    @property
    def tets(self) -> Ints:
        """Numbers of all tetrahedra, ascending."""
        cubes = np.stack(np.unravel_index(np.arange(int(np.prod(self.cubes))), self.cubes))
        numbers = np.arange(12 * cubes.shape[1]).reshape(3, -1, 4)
        has_next = cubes < np.array(self.cubes)[:, None] - 1
        return np.concatenate([numbers[axis][has_next[axis]].ravel() for axis in range(3)])

    def tet_at(self, points: FloatArray) -> Ints:
        """Return the number of the tetrahedron that contains each point, (k,).

        The points must lie within the inner cubes.
        """
        coordinates = (points - self.origin) / self.edge
        cube = coordinates.astype(np.int64)
        offset = coordinates - cube - 0.5
        axis = np.argmax(np.abs(offset), axis=1)
        rows = np.arange(len(points))
        cube[rows, axis] -= offset[rows, axis] < 0  # the lower of the two cubes that share the face
        u, v = offset[rows, (axis + 1) % 3], offset[rows, (axis + 2) % 3]
        side = np.where(np.abs(u) >= np.abs(v), (u < 0).astype(np.int64), 2 + (v < 0))
        face = axis * int(np.prod(self.cubes)) + np.ravel_multi_index(tuple(cube.T), self.cubes)
        return np.asarray(face * 4 + side)

    def corners_of(self, numbers: Ints) -> Ints:
        """Return the lattice vertices of tetrahedra, (k, 4), in an order that makes volumes positive."""
        total = int(np.prod(self.cubes))
        side, rest = numbers % 4, numbers // 4
        axis, flat = rest // total, rest % total
        cube = np.stack(np.unravel_index(flat, self.cubes), axis=1)
        rows = np.arange(len(numbers))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        across = cube.copy()
        across[rows, axis] += 1
        along = np.where(side < 2, u, v)
        other = np.where(side < 2, v, u)
        low = across.copy()
        low[rows, along] += (side % 2) == 0
        high = low.copy()
        high[rows, other] += 1
        # Positive volumes need a reversed edge on sides 1 and 2 of the face.
        is_reversed = ((side % 2) == 1) ^ (side >= 2)
        a, b = self._corner(low), self._corner(high)
        corners = [
            self._center(cube),
            self._center(across),
            np.where(is_reversed, b, a),
            np.where(is_reversed, a, b),
        ]
        return np.stack(corners, axis=1)

    def points_of(self, vertices: Ints) -> FloatArray:
        """Return the positions of lattice vertices, (k, 3) [m]."""
        shape = tuple(n + 1 for n in self.cubes)
        is_center = vertices >= np.prod(shape)
        corner = np.stack(np.unravel_index(np.where(is_center, 0, vertices), shape), axis=1)
        center = np.stack(
            np.unravel_index(np.where(is_center, vertices - np.prod(shape), 0), self.cubes), axis=1
        )
        return self.origin + self.edge * np.where(is_center[:, None], center + 0.5, corner)

    def _corner(self, coordinates: Ints) -> Ints:
        return np.asarray(np.ravel_multi_index(tuple(coordinates.T), tuple(n + 1 for n in self.cubes)))

    def _center(self, cubes: Ints) -> Ints:
        corners = int(np.prod([n + 1 for n in self.cubes]))
        return np.asarray(np.ravel_multi_index(tuple(cubes.T), self.cubes) + corners)
