"""A solid sphere of nearly equal tetrahedra, subdivided from an icosahedron."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_count, as_positive
from taichi_soft.core.residue import without_residue
from taichi_soft.meshing.arrays import FloatArray, require_tet_count
from taichi_soft.meshing.tet_mesh import TetMesh

UNIT: NDArray[np.int64] = np.eye(4, dtype=np.int64)
# The octahedron in the middle of a divided tetrahedron. Each corner is the sum of two of the four directions.
# Opposite corners use disjoint pairs of directions. Each of the three diagonals divides the octahedron into
# four tetrahedra that surround the diagonal.
PAIRS = list(combinations(range(4), 2))
OCTAHEDRON: NDArray[np.int64] = np.array([UNIT[i] + UNIT[j] for i, j in PAIRS])
DIAGONALS = ((0, 5, (1, 2, 4, 3)), (1, 4, (0, 2, 5, 3)), (2, 3, (0, 1, 5, 4)))


def sphere(radius: float = 0.5, resolution: int = 4) -> TetMesh:
    """Make a ball centred at the origin.

    Twenty tetrahedra connect the centre with the faces of an icosahedron. Each of the twenty is divided into
    resolution**3 smaller tetrahedra, and each layer of vertices is projected onto a sphere.

    Args:
        radius: radius of the sphere through the outer vertices [m]. The volume of the mesh is smaller than
            the volume of the ball. The difference falls with the square of the resolution.
        resolution: number of divisions of each edge. There are 20 * resolution**3 tetrahedra. The smallest
            dihedral angle is 44 degrees at the default resolution and 39.8 degrees at a resolution of 10.
    Raises: OptionError for a radius that is not positive or a resolution below 1.
    Example:
        apple = sphere(radius=0.04, resolution=3)
        print(len(apple.tets), apple.quality.summary())
    """
    radius, resolution = as_positive(radius, "radius", "m"), as_count(resolution, "resolution")
    require_tet_count(20 * resolution**3)
    corners, faces = _icosahedron()
    lattice, cells, octahedra = _cut_tetrahedron(resolution)
    positions = np.concatenate([_shells(corners[face], lattice) for face in faces])
    offsets = (np.arange(len(faces)) * len(lattice))[:, None, None]

    # Neighbouring sectors share points. Merge equal points, with a tolerance far below the shortest edge.
    rounded = np.round(positions * (1000 * resolution)).astype(np.int64)
    _, kept, merged = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    merged = merged.reshape(-1)
    vertices = positions[kept]
    tetrahedra = merged[(cells + offsets).reshape(-1, 4)]
    split = _split(vertices, merged[(octahedra + offsets).reshape(-1, 6)])
    return TetMesh(radius * vertices, np.concatenate([tetrahedra, split]), fix_orientation=True)


def _icosahedron() -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the corners on the unit sphere, (12, 3), and the faces, (20, 3)."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    signs = [(s, t) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    corners = np.array([np.roll((0.0, s, t * golden), axis) for axis in range(3) for s, t in signs])
    is_edge = (
        np.linalg.norm(corners[:, None] - corners, axis=2) < 2.1
    )  # edges have length 2, other pairs are at least 3.2 apart
    faces = [
        f
        for f in combinations(range(12), 3)
        if is_edge[f[0], f[1]] and is_edge[f[1], f[2]] and is_edge[f[0], f[2]]
    ]
    return corners / np.linalg.norm(corners[0]), np.array(faces)


def _cut_tetrahedron(pieces: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Divide a tetrahedron into `pieces` along each edge.

    Returns: the points, (p, 4), as integer distances from the four faces, which add up to `pieces`; the small
        tetrahedra, (c, 4); and the octahedra between them, (o, 6), with corners in the order of PAIRS.
    """
    grid = np.indices((pieces + 1,) * 3).reshape(3, -1).T
    grid = grid[grid.sum(axis=1) <= pieces]
    lattice = np.column_stack([grid, pieces - grid.sum(axis=1)])
    index_at = np.full((pieces + 1,) * 3, -1)
    index_at[tuple(grid.T)] = np.arange(len(grid))

    def place(shape: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the point indices of copies of `shape` at all places in the tetrahedron where it fits."""
        size = pieces - int(shape[0].sum())
        low = np.indices((max(size, 0) + 1,) * 3).reshape(3, -1).T
        low = low[low.sum(axis=1) <= size]
        corners = low[:, None, :] + shape[:, :3]
        placed: NDArray[np.int64] = index_at[tuple(np.moveaxis(corners, 2, 0))]
        return placed

    tetrahedra = np.concatenate([place(UNIT), place(1 - UNIT)])
    return lattice, tetrahedra, place(OCTAHEDRON)


def _shells(face: FloatArray, lattice: NDArray[np.int64]) -> FloatArray:
    """Return the positions of lattice points between the centre and a face, (k, 3).

    Args:
        face: corners of the face, (3, 3).
        lattice: weights of the three corners and of the centre, (k, 4).
    """
    step = lattice[:, :3].sum(axis=1)
    angle = np.arccos(face[0] @ face[1])
    # With sines of fractions of the angle, points are evenly spaced on a great circle. Adjacent faces get
    # equal points on their common edge.
    weights = np.sin(lattice[:, :3] / np.maximum(step, 1)[:, None] * angle)
    direction = (weights[:, :, None] * face).sum(axis=1)  # summed in a fixed order on every machine
    length = np.linalg.norm(direction, axis=1)
    radius = step / lattice.sum(axis=1)
    points: FloatArray = direction * (radius / np.where(length > 0, length, 1.0))[:, None]
    return without_residue(points)


def _split(vertices: FloatArray, octahedra: NDArray[np.int64]) -> NDArray[np.int64]:
    """Divide each octahedron (o, 6) into four tetrahedra around its shortest diagonal."""
    if len(octahedra) == 0:
        return np.zeros((0, 4), dtype=np.int64)
    ends = vertices[octahedra[:, [d[:2] for d in DIAGONALS]]]
    # Rounded, so that equal diagonals compare equal on every machine and the first is chosen.
    shortest = np.round(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2), 9).argmin(axis=1)
    rounds = [[(a, b, r, ring[(i + 1) % 4]) for i, r in enumerate(ring)] for a, b, ring in DIAGONALS]
    pieces = np.array(rounds)[shortest].reshape(len(octahedra), 16)
    return np.take_along_axis(octahedra, pieces, axis=1).reshape(-1, 4)
