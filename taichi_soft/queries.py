"""Questions to the surfaces of all bodies, as they are after the last step. Nothing is changed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.checks import as_array, as_number, as_rotation, as_vector
from taichi_soft.constants import POSITION_LIMIT
from taichi_soft.errors import OptionError
from taichi_soft.kernels.queries import find_closest, find_hits, find_overlaps
from taichi_soft.state import State

if TYPE_CHECKING:
    from taichi_soft.body import Body

Floats = NDArray[np.float64]

_ENDLESS = 3e38
"""Stands for no limit [m or m^2]: kernels need not know infinity."""


@dataclass(frozen=True, eq=False)
class RayHit:
    """Where a ray meets a surface first."""

    body: Body
    triangle: int  # row of body.surface
    vertices: NDArray[np.int32]  # (3,) of that triangle
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1
    distance: float  # [m] from the ray's origin
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) of the triangle, unit length, outward


@dataclass(frozen=True, eq=False)
class RayHits:
    """Where each of n rays meets a surface first; a ray that hits nothing has body and triangle -1,
    distance infinity and NaN in the rest."""

    body: NDArray[np.int32]  # (n,) index in world.bodies
    triangle: NDArray[np.int32]  # (n,) row of that body's surface
    barycentrics: Floats  # (n, 3)
    distance: Floats  # (n,) [m]
    point: Floats  # (n, 3) [m]
    normal: Floats  # (n, 3)


@dataclass(frozen=True, eq=False)
class ClosestPoint:
    """The point of all surfaces that is nearest to a given one."""

    body: Body
    triangle: int | None  # row of body.surface; None for a body without triangles
    vertices: NDArray[np.int32]  # (3,) of that triangle, or the nearest vertex three times
    barycentrics: Floats  # (3,) weights of these vertices; their sum is 1
    distance: float  # [m], never negative
    point: Floats  # (3,) [m]
    normal: Floats  # (3,) of the triangle, unit length, outward; without a triangle, towards the given point
    is_inside: bool  # whether the given point lies inside this body


@dataclass(frozen=True, eq=False)
class Overlap:
    """A body that touches a shape."""

    body: Body
    vertices: NDArray[np.int32]  # that lie in the shape, ascending; none where a face or the whole body does


def cast_ray(
    state: State,
    handles: Sequence[Body],
    origin: ArrayLike,
    direction: ArrayLike,
    max_distance: float,
    bodies: Iterable[Body] | None,
    cull_back: bool,
) -> RayHit | None:
    """The first hit of one ray. Raises: OptionError, see `World.raycast`."""
    rays = np.empty((1, 8), dtype=np.float32)
    rays[0, :3] = as_vector(origin, "origin", "m")
    rays[0, 3:6] = _as_directions(as_array(direction, "direction", (3,))[None], "direction")
    hits = _hits(state, handles, rays, max_distance, bodies, cull_back)
    body, face, distance, weights, point, normal = _place(hits[0])
    if body < 0:
        return None
    hit = handles[body]
    return RayHit(hit, face, hit.surface[face], weights, distance, point, normal)


def cast_rays(
    state: State,
    handles: Sequence[Body],
    origins: ArrayLike,
    directions: ArrayLike,
    max_distance: float,
    bodies: Iterable[Body] | None,
    cull_back: bool,
) -> RayHits:
    """The first hit of each ray. Raises: OptionError, see `World.raycasts`."""
    starts = as_array(origins, "origins", (None, 3), "m")
    ways = as_array(directions, "directions", (len(starts), 3))
    if len(starts) and not np.abs(starts).max() < POSITION_LIMIT:
        raise OptionError(f"origins must lie within {POSITION_LIMIT:g} m of zero")
    rays = np.empty((len(starts), 8), dtype=np.float32)
    rays[:, :3] = starts
    rays[:, 3:6] = _as_directions(ways, "directions")
    hits = _hits(state, handles, rays, max_distance, bodies, cull_back).astype(np.float64)
    missed = hits[:, 10] < 0
    hits[missed, 0], hits[missed, 1:10] = np.inf, np.nan
    body, triangle = hits[:, 10].astype(np.int32), hits[:, 11].astype(np.int32)
    return RayHits(body, triangle, hits[:, 1:4], hits[:, 0], hits[:, 4:7], hits[:, 7:10])


def find_closest_point(
    state: State,
    handles: Sequence[Body],
    point: ArrayLike,
    max_distance: float,
    bodies: Iterable[Body] | None,
) -> ClosestPoint | None:
    """The nearest point of all surfaces. Raises: OptionError, see `World.closest_point`."""
    asked = np.empty(4, dtype=np.float32)
    asked[:3] = as_vector(point, "point", "m")
    reach = _as_reach(max_distance)
    asked[3] = _just_beyond(reach * reach)
    found = np.full((1, 13), -1.0, dtype=np.float32)
    chosen = _as_chosen(bodies, handles)
    if len(chosen):
        find_closest(state, chosen, asked, found)
    index, face, distance, weights, place, normal = _place(found[0])
    if index < 0:
        return None
    body = handles[index]
    is_inside = bool(found[0, 12])
    if len(body.surface) == 0:
        vertices = np.full(3, face, dtype=np.int32)
        return ClosestPoint(body, None, vertices, weights, distance, place, normal, is_inside)
    return ClosestPoint(body, face, body.surface[face], weights, distance, place, normal, is_inside)


def find_in_sphere(
    state: State, handles: Sequence[Body], center: ArrayLike, radius: float
) -> tuple[Overlap, ...]:
    """Bodies that touch a sphere. Raises: OptionError, see `World.overlap_sphere`."""
    shape = np.zeros((5, 3), dtype=np.float32)
    shape[0] = as_vector(center, "center", "m")
    shape[1:4] = np.eye(3)
    shape[4] = as_number(radius, "radius", 1e-9, POSITION_LIMIT, _LENGTH)
    return _overlaps(state, handles, False, shape)


def find_in_box(
    state: State, handles: Sequence[Body], center: ArrayLike, size: ArrayLike, rotation: Any
) -> tuple[Overlap, ...]:
    """Bodies that touch a box. Raises: OptionError, see `World.overlap_box`."""
    shape = np.zeros((5, 3), dtype=np.float32)
    shape[0] = as_vector(center, "center", "m")
    shape[1:4] = as_rotation(rotation).T
    lengths = as_vector(size, "size", "m")
    if not (lengths >= 1e-9).all():
        raise OptionError(f"size must be three lengths above 0 m, got {lengths.tolist()}")
    shape[4] = lengths
    return _overlaps(state, handles, True, shape)


_LENGTH = f"a length from 1e-9 to {POSITION_LIMIT:g} m"


def _hits(
    state: State,
    handles: Sequence[Body],
    rays: NDArray[np.float32],
    max_distance: float,
    bodies: Iterable[Body] | None,
    cull_back: bool,
) -> NDArray[np.float32]:
    """One row for each ray, see `write_place`; body -1 where it hits nothing."""
    if not isinstance(cull_back, (bool, np.bool_)):
        raise OptionError(f"cull_back must be True or False, got {cull_back!r}")
    rays[:, 6] = _just_beyond(_as_reach(max_distance))
    rays[:, 7] = cull_back
    hits = np.full((len(rays), 12), -1.0, dtype=np.float32)
    chosen = _as_chosen(bodies, handles)
    if len(rays) and len(chosen):
        find_hits(state, len(rays) < _FEWEST_SHARED, chosen, rays, hits)
    return hits


_FEWEST_SHARED = 32
"""Rays from which on threads share them: waking them costs as much as some rays."""


def _overlaps(
    state: State, handles: Sequence[Body], is_box: bool, shape: NDArray[np.float32]
) -> tuple[Overlap, ...]:
    first_vertex = np.full(len(handles), -1, dtype=np.int32)
    inside = np.zeros(state.capacity.particles, dtype=np.int32)
    find_overlaps(state, is_box, len(handles), shape, first_vertex, inside)
    overlaps = []
    for index in np.flatnonzero(first_vertex >= 0).tolist():
        begin, body = first_vertex[index], handles[index]
        vertices = np.flatnonzero(inside[begin : begin + body.vertex_count])
        overlaps.append(Overlap(body, vertices.astype(np.int32)))
    return tuple(overlaps)


def _place(row: NDArray[np.float32]) -> tuple[int, int, float, Floats, Floats, Floats]:
    """Body, face, distance, weights, point and normal."""
    real = row.astype(np.float64)
    return int(real[10]), int(real[11]), float(real[0]), real[1:4], real[4:7], real[7:10]


def _as_directions(rows: Floats, name: str) -> Floats:
    """Rows of length 1. Raises: OptionError for one of zero length."""
    largest = np.abs(rows).max(axis=1, initial=0.0)
    if not largest.all():
        which = f" {int(largest.argmin())}" if len(rows) > 1 else ""
        raise OptionError(f"{name}{which} has zero length: a ray needs a direction")
    scaled = rows / largest[:, None]  # whose squares neither vanish nor overflow
    return np.asarray(scaled / np.linalg.norm(scaled, axis=1)[:, None])


def _as_reach(max_distance: float) -> float:
    """A distance above 0; infinity stays what it is. Raises: OptionError."""
    if isinstance(max_distance, (float, np.floating)) and max_distance == math.inf:
        return math.inf
    reach = as_number(max_distance, "max_distance", 0.0, math.inf, "a number above 0 m, or infinity")
    if reach == 0.0:
        raise OptionError("max_distance must be a number above 0 m, or infinity, got 0")
    return reach


def _just_beyond(limit: float) -> np.float32:
    """The least float32 above: kernels take what is nearer, and the limit itself still counts."""
    return np.nextafter(np.float32(min(limit, _ENDLESS)), np.float32(np.inf))


def _as_chosen(bodies: Iterable[Body] | None, handles: Sequence[Body]) -> NDArray[np.int32]:
    """Indices of the bodies asked, ascending; all for None. Raises: OptionError."""
    if bodies is None:
        return np.arange(len(handles), dtype=np.int32)
    if isinstance(bodies, (str, bytes)) or not isinstance(bodies, Iterable):
        raise OptionError(f"bodies must be a list of this world's bodies or None, got {bodies!r}")
    chosen = set()
    for body in bodies:
        index = getattr(body, "index", None)
        if not isinstance(index, int) or not 0 <= index < len(handles) or handles[index] is not body:
            raise OptionError(f"bodies must be bodies of this world, got {body!r}")
        chosen.add(index)
    return np.array(sorted(chosen), dtype=np.int32)
