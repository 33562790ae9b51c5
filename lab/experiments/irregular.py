"""Cubes of irregular tetrahedra, like those from a mesher."""

from __future__ import annotations

import numpy as np

from taichi_soft import TetMesh, box, delaunay_mesh

SHAKEN = 0.25
"""Largest displacement of a vertex along an axis [cell edge]."""


def cube(cells: int, seed: int | None = None) -> TetMesh:
    """Make a cube of edge 1 m about the origin.

    Args:
        cells: number of cells along each edge.
        seed: seed of the random displacements; None for a regular grid. Vertices on the surface move along
            it, and Delaunay's rule reconnects all vertices.
    """
    regular = box((1.0, 1.0, 1.0), (cells, cells, cells))
    if seed is None:
        return regular
    ways = np.random.default_rng(seed).uniform(-SHAKEN, SHAKEN, regular.vertices.shape) / cells
    is_inside = np.abs(regular.vertices) < 0.5 - 1e-9
    return delaunay_mesh(TetMesh(regular.vertices + ways * is_inside, regular.tets))
