"""The point of the deformed surfaces that is nearest to a given one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_vector
from taichi_soft.queries.kernels import find_closest
from taichi_soft.queries.query import as_chosen, as_reach, just_beyond, read_answer

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClosestPoint:
    """The point of all surfaces that is nearest to a given one."""

    body: SoftBody  # that has the point
    triangle: int | None  # row of body.surface; None for a body without triangles
    vertices: NDArray[np.int32]  # (3,) of that triangle, or the nearest vertex three times
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1
    distance: float  # [m], never negative
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) of the triangle, unit length, outward; of one without area, towards the given point
    is_inside: bool  # whether the given point lies inside this body


def find_closest_point(
    state: BodyFields,
    handles: Sequence[SoftBody | None],
    point: ArrayLike,
    max_distance: float,
    bodies: Iterable[SoftBody] | None,
) -> ClosestPoint | None:
    """The nearest point of all surfaces. Raises: OptionError, see `World.closest_point`."""
    asked = np.empty(4, dtype=np.float32)
    asked[:3] = as_vector(point, "point", "m")
    reach = as_reach(max_distance)
    asked[3] = just_beyond(reach * reach)
    found = np.full((1, 13), -1.0, dtype=np.float32)
    chosen = as_chosen(bodies, handles)
    if len(chosen):
        find_closest(state, chosen, asked, found)
    index, face, distance, weights, nearest, normal = read_answer(found[0])
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
