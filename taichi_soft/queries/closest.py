"""Closest point on the deformed surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_vector
from taichi_soft.queries.kernels import find_closest
from taichi_soft.queries.query import as_body_indices, as_max_distance, next_above, unpack_result

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClosestPoint:
    """The point on the surfaces that is closest to a given point."""

    body: SoftBody  # body on whose surface the closest point lies
    triangle: int | None  # row of body.surface; None for a body without triangles
    vertices: NDArray[np.int32]  # (3,) corners of that triangle, or the nearest vertex three times
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1
    distance: float  # [m], never negative
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) outward unit normal; for a triangle without area, towards the given point
    is_inside: bool  # True if the given point lies inside this body


def find_closest_point(
    state: BodyFields,
    handles: Sequence[SoftBody | None],
    point: ArrayLike,
    max_distance: float,
    bodies: Iterable[SoftBody] | None,
) -> ClosestPoint | None:
    """Return the point on the surfaces that is closest to `point`, None if no surface is in range.

    Raises: OptionError, see `World.closest_point`.
    """
    query = np.empty(4, dtype=np.float32)
    query[:3] = as_vector(point, "point", "m")
    limit = as_max_distance(max_distance)
    query[3] = next_above(limit * limit)
    found = np.full((1, 13), -1.0, dtype=np.float32)
    chosen = as_body_indices(bodies, handles)
    if len(chosen):
        find_closest(state, chosen, query, found)
    index, face, distance, weights, nearest, normal = unpack_result(found[0])
    if index < 0:
        return None
    body = handles[index]
    assert body is not None
    triangle, vertices = (
        (face, body.surface[face]) if len(body.surface) else (None, np.full(3, face, np.int32))
    )
    return ClosestPoint(
        body, triangle, vertices, weights, distance, nearest, normal, is_inside=bool(found[0, 12])
    )
