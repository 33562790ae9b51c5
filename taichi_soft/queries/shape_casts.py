"""Casts of spheres, capsules and boxes against the deformed surfaces of bodies, and against colliders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.shapes import BoxShape, CapsuleShape, SphereShape
from taichi_soft.core.checks import as_array, as_rotation, as_vector
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.rotations import quaternion_of
from taichi_soft.queries.kernels.casts import cast_on_bodies
from taichi_soft.queries.kernels.colliders import CAST_WIDTH, cast_on_colliders
from taichi_soft.queries.kernels.convex import BLOCK, POINT, SEGMENT
from taichi_soft.queries.query import Targets, as_max_distance, next_above, unpack_result
from taichi_soft.queries.rays import unit_directions

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ShapeHit:
    """First touch of a moving shape with a surface."""

    body: SoftBody | None  # the body that was touched; None for a collider
    collider: Collider | None  # the collider that was touched; None for a body
    triangle: int  # row of body.surface; -1 for a collider, and for a body without triangles
    vertices: NDArray[np.int32]  # (3,) corners of that triangle, or the touched vertex three times
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1. Both are empty for a collider
    distance: float  # [m] by which the shape moves until the touch; 0 if it overlaps at the start
    depth: float  # [m] of the overlap at the start along the normal, or 0
    point: Floats  # (3,) point of the surface [m]
    normal: Floats  # (3,) unit vector from the surface to the shape


def cast_shape(
    targets: Targets,
    shape: Any,
    position: ArrayLike,
    direction: ArrayLike,
    rotation: Any,
    max_distance: float,
) -> ShapeHit | None:
    """Return the first touch of a moving shape, or None. Raises: OptionError, see `World.shapecast`."""
    cast = np.zeros((1, CAST_WIDTH), dtype=np.float32)
    cast[0, :3] = as_vector(position, "position", "m")
    cast[0, 3:6] = unit_directions(as_array(direction, "direction", (3,))[None], "direction")
    cast[0, 6] = next_above(as_max_distance(max_distance))
    cast[0, 7:12] = _core_of(shape)
    cast[0, 12:] = quaternion_of(as_rotation(rotation))
    hits = np.full((1, 13), -1.0, dtype=np.float32)
    if len(targets.bodies):
        cast_on_bodies(targets.state, targets.bodies, cast, hits)
    if len(targets.colliders):
        cast_on_colliders(targets.state, True, targets.colliders, targets.poses, cast, hits)
    index, face, signed, weights, point, normal = unpack_result(hits[0])
    distance, depth = max(signed, 0.0), max(-signed, 0.0)
    body, collider = targets.body(index), targets.collider(int(hits[0, 12]))
    if collider is not None:
        none, empty = np.zeros(0, np.int32), np.zeros(0)
        return ShapeHit(None, collider, -1, none, empty, distance, depth, point, normal)
    if body is None:
        return None
    triangle, vertices = (face, body.surface[face]) if len(body.surface) else (-1, np.full(3, face, np.int32))
    return ShapeHit(body, None, triangle, vertices, weights, distance, depth, point, normal)


def _core_of(shape: Any) -> tuple[float, ...]:
    """Return kind of the core, half of its lengths (3) [m] and radius [m] of a shape. Raises: OptionError."""
    if isinstance(shape, SphereShape):
        return (POINT, 0.0, 0.0, 0.0, shape.parameters[0])
    if isinstance(shape, CapsuleShape):
        return (SEGMENT, 0.0, 0.0, shape.parameters[1], shape.parameters[0])
    if isinstance(shape, BoxShape):
        return (BLOCK, *shape.parameters[:3], 0.0)
    raise OptionError(f"shape must be a SphereShape, a CapsuleShape or a BoxShape, got {shape!r}")
