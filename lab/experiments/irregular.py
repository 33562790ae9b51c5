"""Cubes of irregular tetrahedra, like those of a mesher."""

from __future__ import annotations

import numpy as np

from taichi_soft import TetMesh, box, delaunay_mesh

SHAKEN = 0.25
"""Largest displacement of a vertex along an axis, over the edge of a cell."""


def cube(cells: int, seed: int | None = None) -> TetMesh:
    """A cube of edge 1 m about the origin.

    Args:
        cells: number along each edge.
        seed: seed of the displacements. Vertices on the surface move along it. Delaunay's rule then connects
            them anew. None leaves a regular grid.
    """
    regular = box((1.0, 1.0, 1.0), (cells, cells, cells))
    if seed is None:
        return regular
    ways = np.random.default_rng(seed).uniform(-SHAKEN, SHAKEN, regular.vertices.shape) / cells
    is_inside = np.abs(regular.vertices) < 0.5 - 1e-9
    return delaunay_mesh(TetMesh(regular.vertices + ways * is_inside, regular.tets))
