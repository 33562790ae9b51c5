"""Random meshes with extreme tetrahedra."""

import numpy as np
from scipy.spatial import Delaunay

from taichi_soft import TetMesh


def scattered(count, seed, size=(1.0, 1.0, 1.0), flattest=1e-4):
    """Delaunay tetrahedra of random points: slivers of every kind.

    `flattest` is the smallest ratio of a tetrahedron's volume to the cube of its longest edge.
    """
    x = np.random.default_rng(seed).uniform(0, 1, (count, 3)) * size
    tets = Delaunay(x).simplices
    corners = x[tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    tets[volumes < 0] = tets[volumes < 0][:, [0, 2, 1, 3]]
    return TetMesh(x, tets[np.abs(volumes) > flattest * longest**3])
