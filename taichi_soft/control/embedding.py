"""Points embedded in a body. Each point follows the vertices of a tetrahedron."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody, record_of
from taichi_soft.control.kernels.embedding import embed_points
from taichi_soft.core.errors import OptionError

Floats = NDArray[np.float64]

FARTHEST = -0.5
"""Smallest allowed weight of a vertex. A point with this weight is outside its tetrahedron, but inside the
same tetrahedron scaled by 3 about its centre."""


@dataclass(frozen=True)
class Places:
    """Barycentric coordinates of n points. The four weights of a point sum to 1."""

    vertices: NDArray[np.int32]  # (n, 4), vertices that carry each point
    weights: Floats  # (n, 4), weights of these vertices


def places_at(body: SoftBody, points: Floats, names: list[str]) -> Places:
    """Embed points (n, 3) [m] in the tetrahedra of a body in its current shape.

    A point outside the body gets the tetrahedron in which the smallest of the point's weights is largest.
    Raises: OptionError with the name of the first point that is too far away, or for a body without
        tetrahedra.
    """
    if len(body.tets) == 0:
        raise OptionError(
            f"body {body.index} has no tetrahedra: attach it to the other body instead, or give its "
            "vertices in onto"
        )
    positions = body.positions().astype(np.float64)
    corners, weights = embedded(points, positions, body.tets)
    is_far = weights.min(axis=1) < FARTHEST
    if record_of(body).description.is_rigid:  # points of a rigid body can be at any distance
        is_far[:] = False
    for i in np.flatnonzero(is_far):
        nearest = np.linalg.norm(positions - points[i], axis=1).min()
        raise OptionError(
            f"{names[i]} is too far from body {body.index}, {nearest:.4g} m from its nearest vertex: "
            "move the two together first, or give vertices in onto"
        )
    weights[np.abs(weights) < 1e-4] = 0.0  # round-off: these vertices must not carry the point
    return Places(corners, weights / weights.sum(axis=1, keepdims=True))


def embedded(points: Floats, x: Floats, tets: NDArray[np.int32]) -> tuple[NDArray[np.int32], Floats]:
    """Return the vertices and barycentric coordinates of points (k, 3) in tetrahedra: see `embed_points`."""
    corners, weights = np.empty((len(points), 4), dtype=np.int32), np.empty((len(points), 4))
    embed_points(points, x, tets, corners, weights)
    return corners, weights


def places_on(body: SoftBody, vertices: NDArray[np.int32]) -> Places:
    """Embed vertices of a body, each in the first tetrahedron of which it is a corner.

    In a body without tetrahedra, the four vertices of a point are copies of the vertex.
    """
    corners = np.repeat(vertices[:, None], 4, axis=1)
    if len(body.tets):
        flat = body.tets.ravel()
        first = np.zeros(body.vertex_count, dtype=np.int64)
        first[flat[::-1]] = np.arange(len(flat))[::-1] // 4
        corners = body.tets[first[vertices]]
    is_it = corners == vertices[:, None]
    weights = np.zeros(corners.shape)
    weights[np.arange(len(vertices)), np.argmax(is_it, axis=1)] = 1.0
    return Places(corners.astype(np.int32), weights)
