"""Closest point on the deformed surfaces of bodies, and on colliders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.core.checks import as_vector
from taichi_soft.queries.kernels.bodies import find_closest
from taichi_soft.queries.kernels.colliders import closest_on_colliders
from taichi_soft.queries.query import Targets, as_max_distance, next_above, unpack_result

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClosestPoint:
    """The point on the surfaces that is closest to a given point."""

    body: SoftBody | None  # body on whose surface the closest point lies; None for a collider
    collider: Collider | None  # collider on whose surface the closest point lies; None for a body
    triangle: int | None  # row of body.surface; None for a body without triangles, and for a collider
    vertices: NDArray[np.int32]  # (3,) corners of that triangle, or the nearest vertex three times
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1. Both are empty for a collider
    distance: float  # [m], never negative
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) outward unit normal; for a triangle without area, towards the given point
    is_inside: bool  # True if the given point lies inside this body or collider


def find_closest_point(targets: Targets, point: ArrayLike, max_distance: float) -> ClosestPoint | None:
    """Return the point on the surfaces that is closest to `point`, None if no surface is in range.

    Raises: OptionError, see `World.closest_point`.
    """
    query = np.empty(4, dtype=np.float32)
    query[:3] = as_vector(point, "point", "m")
    limit = as_max_distance(max_distance)
    query[3] = next_above(limit * limit)
    found = np.full((1, 14), -1.0, dtype=np.float32)
    if len(targets.bodies):
        find_closest(targets.state, targets.bodies, query, found)
    if len(targets.colliders):
        closest_on_colliders(targets.state, targets.colliders, targets.poses, query, found)
    index, face, distance, weights, nearest, normal = unpack_result(found[0])
    is_inside = bool(found[0, 12] > 0.0)
    body, collider = targets.body(index), targets.collider(int(found[0, 13]))
    if collider is not None:
        none, empty = np.zeros(0, np.int32), np.zeros(0)
        return ClosestPoint(None, collider, None, none, empty, distance, nearest, normal, is_inside)
    if body is None:
        return None
    triangle, vertices = (
        (face, body.surface[face]) if len(body.surface) else (None, np.full(3, face, np.int32))
    )
    return ClosestPoint(body, None, triangle, vertices, weights, distance, nearest, normal, is_inside)
