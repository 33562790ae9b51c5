"""A hull bound to the tetrahedra of a cage: points of the artist's surface that touch others for it.

A point lies at weights w of the four vertices of a tetrahedron, x = sum_i w_i x_i, and moves with the same
weights. An impulse P at it is w_i P at each vertex: its inverse mass is sum_i w_i^2 / m_i, and as w_i P acts
at x_i in place of P at x, momentum and angular momentum are what they would be.

A point outside of the cage goes on with the nearest tetrahedron, as if that were larger.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.cages.hull import Hull
from taichi_soft.core.errors import MeshError
from taichi_soft.core.math.barycentric import barycentric
from taichi_soft.meshing import TetMesh
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.locating import Locator

Floats = NDArray[np.float64]
Ints32 = NDArray[np.int32]

FARTHEST = -2.0
"""Least weight: a point lies in a tetrahedron drawn out ninefold from its centre, or is moved there. Farther
out what strikes it would move the nearest vertices by many times its own way."""


@dataclass(frozen=True, eq=False)
class BoundHull:
    """What all bodies of an asset share."""

    vertices: Ints32  # (h, 4), of the mesh
    weights: Floats  # (h, 4), of these; they add up to 1
    points: Floats  # (h, 3) where they are at rest [m]
    triangles: Ints32  # (t, 3), of the points

    @property
    def mean_edge(self) -> float:
        """Mean edge of the triangles [m]."""
        ends = self.points[self.triangles]
        return float(np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).mean())


def bind(mesh: TetMesh, hull: Hull) -> BoundHull:
    """A hull bound to a mesh at rest.

    Raises: MeshError where most points are too far from the mesh to be of the same thing.
    """
    tets, nearest = Locator(mesh)(hull.points)
    corners = mesh.vertices[mesh.tets[tets]]
    way = barycentric(hull.points, corners) - nearest
    # As far along the way from the nearest point of the mesh as weights allow; float32 adds up to 1 later.
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = np.where(way < 0.0, (FARTHEST - nearest) / way, np.inf).min(axis=1)
    moved = int((allowed < 1.0).sum())
    if 2 * moved > len(allowed):
        low, high = hull.points.min(axis=0), hull.points.max(axis=0)
        raise MeshError(
            f"{moved} of {len(allowed)} points of the hull, which lies from {low.round(4).tolist()} to "
            f"{high.round(4).tolist()} m, are far from {mesh!r}: give one of the same thing"
        )
    weights = nearest + np.minimum(allowed, 1.0)[:, None] * way
    vertices = mesh.tets[tets].astype(np.int32)
    points = (weights[:, :, None] * corners).sum(axis=1)
    return BoundHull(read_only(vertices), read_only(weights), read_only(points), hull.triangles)
