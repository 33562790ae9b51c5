"""Hull of a body, bound to the tetrahedra of its cage. A hull contains the points that make contact.

A point x has a weight w_i for each vertex x_i of a tetrahedron, so that x = sum_i w_i x_i at any time. An
impulse P at the point acts on each vertex as w_i P, so the point has the inverse mass sum_i w_i^2 / m_i.
Momentum and angular momentum are conserved, because the impulses w_i P at x_i are equivalent to P at x.

A point outside the cage follows the nearest tetrahedron, extrapolated beyond its faces.
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
from taichi_soft.meshing.rigid_mesh import RigidMesh

Floats = NDArray[np.float64]
Ints32 = NDArray[np.int32]

MIN_WEIGHT = -2.0
"""Smallest allowed weight of a vertex. It keeps each point inside its tetrahedron scaled by 9 about the
centre. An impact on a point farther out would move the nearest vertices by many times the displacement of
the point."""


@dataclass(frozen=True, eq=False)
class BoundHull:
    """Binding of a hull to a mesh, shared by all bodies of an asset."""

    vertices: Ints32  # (h, 4), vertices of the mesh that carry each point
    weights: Floats  # (h, 4), weights of these vertices, which sum to 1
    points: Floats  # (h, 3), positions at rest [m]
    triangles: Ints32  # (t, 3), indices of points

    @property
    def mean_edge(self) -> float:
        """Mean edge length of the triangles [m]."""
        ends = self.points[self.triangles]
        return float(np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).mean())


def bind(mesh: TetMesh, hull: Hull) -> BoundHull:
    """Bind a hull to a mesh at rest, and return the binding. Points of a rigid body can be at any distance.

    Raises: MeshError if most points are too far from the mesh to belong to the same body.
    """
    if isinstance(mesh, RigidMesh):
        carriers = np.repeat(mesh.tets.astype(np.int32), len(hull.points), axis=0)
        shares = barycentric(hull.points, mesh.vertices[carriers])
        return BoundHull(read_only(carriers), read_only(shares), hull.points, hull.triangles)
    tets, nearest = Locator(mesh)(hull.points)
    corners = mesh.vertices[mesh.tets[tets]]
    offset = barycentric(hull.points, corners) - nearest
    # Largest fraction of a point's offset from the mesh that leaves every weight at least `MIN_WEIGHT`.
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = np.where(offset < 0.0, (MIN_WEIGHT - nearest) / offset, np.inf).min(axis=1)
    clamped_count = int((allowed < 1.0).sum())
    if 2 * clamped_count > len(allowed):
        low, high = hull.points.min(axis=0), hull.points.max(axis=0)
        raise MeshError(
            f"{clamped_count} of {len(allowed)} points of the hull, which lies from {low.round(4).tolist()} "
            f"to {high.round(4).tolist()} m, are far from {mesh!r}: pass a hull of the same body"
        )
    weights = nearest + np.minimum(allowed, 1.0)[:, None] * offset
    vertices = mesh.tets[tets].astype(np.int32)
    points = (weights[:, :, None] * corners).sum(axis=1)
    return BoundHull(read_only(vertices), read_only(weights), read_only(points), hull.triangles)
