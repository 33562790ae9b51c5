"""Embedded points, which follow the vertices of a tetrahedron. Numpy only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.barycentric import edge_inverses, shares_by

Floats = NDArray[np.float64]

FARTHEST = -0.5
"""Smallest weight of a corner: points must lie in a tetrahedron that is scaled by three about its centre."""


@dataclass(frozen=True)
class Places:
    """Barycentric coordinates of n points among four vertices each; the weights of a point have the sum 1."""

    vertices: NDArray[np.int32]  # (n, 4)
    weights: Floats  # (n, 4)


def places_at(body: SoftBody, points: Floats, names: list[str]) -> Places:
    """Embed points (n, 3) [m] in the tetrahedra of a body in its current shape. A point outside uses the
    tetrahedron that it is least outside of.

    Raises: OptionError with the name of the first point that is too far away, and for a body without
        tetrahedra.
    """
    if len(body.tets) == 0:
        raise OptionError(
            f"body {body.index} has no tetrahedra: attach it to the other body instead, or give its "
            "vertices in onto"
        )
    positions = body.positions().astype(np.float64)
    corners = positions[body.tets]
    a, b, c = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    is_solid = np.abs((a * np.cross(b, c)).sum(axis=1)) > 1e-30
    tets, starts, inverses = body.tets[is_solid], corners[is_solid, 0], edge_inverses(corners[is_solid])
    weights = np.empty((len(points), 4))
    chosen = np.zeros(len(points), dtype=np.int64)
    for i, point in enumerate(points):
        found = shares_by(inverses, point - starts)
        least = found.min(axis=1) if len(found) else np.array([-np.inf])
        chosen[i] = np.argmax(least)
        if not least[chosen[i]] >= FARTHEST:
            nearest = np.linalg.norm(positions - point, axis=1).min()
            raise OptionError(
                f"{names[i]} is too far from body {body.index}, {nearest:.4g} m from its nearest vertex: "
                "move the two together first, or give vertices in onto"
            )
        weights[i] = found[chosen[i]]
    weights[np.abs(weights) < 1e-4] = 0.0  # rounding must not involve other vertices
    return Places(tets[chosen], weights / weights.sum(axis=1, keepdims=True))


def places_on(body: SoftBody, vertices: NDArray[np.int32]) -> Places:
    """Embed vertices, each through the first tetrahedron that contains it, if any."""
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
