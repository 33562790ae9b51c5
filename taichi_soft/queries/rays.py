"""Ray casts against the deformed surfaces of bodies, and against colliders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.core.checks import as_array, as_flag, as_vector
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.queries.kernels.bodies import find_hits
from taichi_soft.queries.kernels.colliders import CAST_WIDTH, cast_on_colliders
from taichi_soft.queries.query import Targets, as_max_distance, next_above, unpack_result

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHit:
    """First intersection of a ray with a surface."""

    body: SoftBody | None  # the body that was hit; None for a collider
    collider: Collider | None  # the collider that was hit; None for a body
    triangle: int  # row of body.surface; -1 for a collider
    vertices: NDArray[np.int32]  # (3,) corners of that triangle
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1. Both are empty for a collider
    distance: float  # [m] from the ray's origin
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) outward unit normal of the surface


@dataclass(frozen=True, eq=False)
class RayHits:
    """First intersections of n rays with the surfaces.

    A ray that hits nothing has body, collider and triangle -1, distance infinity and NaN in the other arrays.
    `body` contains slots, and a slot can be reused after a despawn. Look up the bodies before the next
    despawn, and the colliders before the next is removed.
    """

    body: NDArray[np.int32]  # (n,) body.index; -1 for a collider
    collider: NDArray[np.int32]  # (n,) collider.index; -1 for a body
    triangle: NDArray[np.int32]  # (n,) row of that body's surface
    barycentrics: Floats  # (n, 3)
    distance: Floats  # (n,) [m]
    point: Floats  # (n, 3) [m]
    normal: Floats  # (n, 3)


def cast_ray(
    targets: Targets, origin: ArrayLike, direction: ArrayLike, max_distance: float, cull_back: bool
) -> RayHit | None:
    """Return the first hit of a ray, None if it hits nothing. Raises: OptionError, see `World.raycast`."""
    rays = np.empty((1, 8), dtype=np.float32)
    rays[0, :3] = as_vector(origin, "origin", "m")
    rays[0, 3:6] = unit_directions(as_array(direction, "direction", (3,))[None], "direction")
    hits = _hits(targets, rays, max_distance, cull_back)
    index, face, distance, weights, point, normal = unpack_result(hits[0])
    body, collider = targets.body(index), targets.collider(int(hits[0, 12]))
    if collider is not None:
        none, empty = np.zeros(0, np.int32), np.zeros(0)
        return RayHit(None, collider, -1, none, empty, distance, point, normal)
    if body is None:
        return None
    return RayHit(body, None, face, body.surface[face], weights, distance, point, normal)


def cast_rays(
    targets: Targets, origins: ArrayLike, directions: ArrayLike, max_distance: float, cull_back: bool
) -> RayHits:
    """Return the first hit of each ray. Raises: OptionError, see `World.raycasts`."""
    starts = as_array(origins, "origins", (None, 3), "m")
    vectors = as_array(directions, "directions", (len(starts), 3))
    if len(starts) and not np.abs(starts).max() < POSITION_LIMIT:
        raise OptionError(f"origins must lie within {POSITION_LIMIT:g} m of zero")
    rays = np.empty((len(starts), 8), dtype=np.float32)
    rays[:, :3] = starts
    rays[:, 3:6] = unit_directions(vectors, "directions")
    hits = _hits(targets, rays, max_distance, cull_back).astype(np.float64)
    body, triangle, collider = (hits[:, column].astype(np.int32) for column in (10, 11, 12))
    missed = (body < 0) & (collider < 0)
    hits[missed, 0], hits[missed, 1:10] = np.inf, np.nan
    return RayHits(body, collider, triangle, hits[:, 1:4], hits[:, 0], hits[:, 4:7], hits[:, 7:10])


def _hits(
    targets: Targets, rays: NDArray[np.float32], max_distance: float, cull_back: bool
) -> NDArray[np.float32]:
    """Return the result of each ray, (n, 13): see `cast_on_colliders`."""
    rays[:, 6] = next_above(as_max_distance(max_distance))
    rays[:, 7] = as_flag(cull_back, "cull_back")
    hits = np.full((len(rays), 13), -1.0, dtype=np.float32)
    is_serial = len(rays) < _MIN_PARALLEL_RAYS
    if len(rays) and len(targets.bodies):
        find_hits(targets.state, is_serial, targets.bodies, rays, hits)
    if len(rays) and len(targets.colliders):
        casts = np.zeros((len(rays), CAST_WIDTH), dtype=np.float32)
        casts[:, :7], casts[:, 15] = rays[:, :7], 1.0  # a point, not rotated
        cast_on_colliders(targets.state, is_serial, targets.colliders, targets.poses, casts, hits)
    return hits


_MIN_PARALLEL_RAYS = 32
"""Smallest number of rays for which several threads are used. Waking the threads takes as long as tracing
about 30 rays."""


def unit_directions(rows: Floats, name: str) -> Floats:
    """Scale rows to length 1. Raises: OptionError for a row of length zero."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    if not largest.all():
        which = f" {int(largest.argmin())}" if len(rows) > 1 else ""
        raise OptionError(f"{name}{which} has zero length: pass a direction of any other length")
    scaled = rows / largest[:, None]  # so that the squares neither underflow nor overflow
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])
