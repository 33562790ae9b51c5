"""Ray casts against the deformed surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_array, as_vector
from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.queries.kernels import find_hits
from taichi_soft.queries.query import as_body_indices, as_max_distance, next_above, unpack_result

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHit:
    """First intersection of a ray with a surface."""

    body: SoftBody  # the body that was hit
    triangle: int  # row of body.surface
    vertices: NDArray[np.int32]  # (3,) corners of that triangle
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1
    distance: float  # [m] from the ray's origin
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) outward unit normal of the triangle


@dataclass(frozen=True, eq=False)
class RayHits:
    """First intersections of n rays with the surfaces.

    A ray that hits nothing has body and triangle -1, distance infinity and NaN in the other arrays. `body`
    contains slots, and a slot can be reused after a despawn. Look up the bodies before the next despawn.
    """

    body: NDArray[np.int32]  # (n,) body.index
    triangle: NDArray[np.int32]  # (n,) row of that body's surface
    barycentrics: Floats  # (n, 3)
    distance: Floats  # (n,) [m]
    point: Floats  # (n, 3) [m]
    normal: Floats  # (n, 3)


def cast_ray(
    state: BodyFields,
    handles: Sequence[SoftBody | None],
    origin: ArrayLike,
    direction: ArrayLike,
    max_distance: float,
    bodies: Iterable[SoftBody] | None,
    cull_back: bool,
) -> RayHit | None:
    """Return the first hit of a ray, None if it hits nothing. Raises: OptionError, see `World.raycast`."""
    rays = np.empty((1, 8), dtype=np.float32)
    rays[0, :3] = as_vector(origin, "origin", "m")
    rays[0, 3:6] = _unit_directions(as_array(direction, "direction", (3,))[None], "direction")
    hits = _hits(state, handles, rays, max_distance, bodies, cull_back)
    body, face, distance, weights, point, normal = unpack_result(hits[0])
    if body < 0:
        return None
    hit = handles[body]
    assert hit is not None
    return RayHit(hit, face, hit.surface[face], weights, distance, point, normal)


def cast_rays(
    state: BodyFields,
    handles: Sequence[SoftBody | None],
    origins: ArrayLike,
    directions: ArrayLike,
    max_distance: float,
    bodies: Iterable[SoftBody] | None,
    cull_back: bool,
) -> RayHits:
    """Return the first hit of each ray. Raises: OptionError, see `World.raycasts`."""
    starts = as_array(origins, "origins", (None, 3), "m")
    vectors = as_array(directions, "directions", (len(starts), 3))
    if len(starts) and not np.abs(starts).max() < POSITION_LIMIT:
        raise OptionError(f"origins must lie within {POSITION_LIMIT:g} m of zero")
    rays = np.empty((len(starts), 8), dtype=np.float32)
    rays[:, :3] = starts
    rays[:, 3:6] = _unit_directions(vectors, "directions")
    hits = _hits(state, handles, rays, max_distance, bodies, cull_back).astype(np.float64)
    missed = hits[:, 10] < 0
    hits[missed, 0], hits[missed, 1:10] = np.inf, np.nan
    body, triangle = hits[:, 10].astype(np.int32), hits[:, 11].astype(np.int32)
    return RayHits(body, triangle, hits[:, 1:4], hits[:, 0], hits[:, 4:7], hits[:, 7:10])


def _hits(
    state: BodyFields,
    handles: Sequence[SoftBody | None],
    rays: NDArray[np.float32],
    max_distance: float,
    bodies: Iterable[SoftBody] | None,
    cull_back: bool,
) -> NDArray[np.float32]:
    """Return a row of `write_result` for each ray, (n, 12). The body is -1 for a ray that hits nothing."""
    if not isinstance(cull_back, (bool, np.bool_)):
        raise OptionError(f"cull_back must be True or False, got {cull_back!r}")
    rays[:, 6] = next_above(as_max_distance(max_distance))
    rays[:, 7] = cull_back
    hits = np.full((len(rays), 12), -1.0, dtype=np.float32)
    chosen = as_body_indices(bodies, handles)
    if len(rays) and len(chosen):
        find_hits(state, len(rays) < _MIN_PARALLEL_RAYS, chosen, rays, hits)
    return hits


_MIN_PARALLEL_RAYS = 32
"""Smallest number of rays for which several threads are used. Waking the threads takes as long as tracing
about 30 rays."""


def _unit_directions(rows: Floats, name: str) -> Floats:
    """Scale rows to length 1. Raises: OptionError for a row of length zero."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    if not largest.all():
        which = f" {int(largest.argmin())}" if len(rows) > 1 else ""
        raise OptionError(f"{name}{which} has zero length: pass a direction of any other length")
    scaled = rows / largest[:, None]  # so that the squares neither underflow nor overflow
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])
