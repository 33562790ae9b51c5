"""Methods of a world for raycasts, closest points and overlaps."""

from __future__ import annotations

import math
from collections.abc import Iterable

from numpy.typing import ArrayLike

from taichi_soft.queries import (
    ClosestPoint,
    Overlap,
    RayHit,
    RayHits,
    cast_ray,
    cast_rays,
    find_closest_point,
    find_in_box,
    find_in_sphere,
)
from taichi_soft.world.body import Body
from taichi_soft.world.world_parts import WorldParts


class WorldQueries(WorldParts):
    """Methods of a world that search the surfaces of its bodies."""

    def raycast(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        cull_back: bool = True,
    ) -> RayHit | None:
        """Find the first hit of a ray on the deformed surfaces after the last step.

        Bodies without triangles, such as ropes, cannot be hit. If several triangles are equally near, the hit
        is on the first triangle of the first body. All queries include frozen bodies.
        Args:
            origin: start of the ray, (3,) [m].
            direction: direction of the ray, (3,), of any nonzero length.
            max_distance: largest distance of a hit [m]; infinity for no limit.
            bodies: bodies to test; None for all.
            cull_back: True ignores back faces, so that a ray from inside a body leaves the body.
        Returns: the hit, or None.
        Raises: OptionError for numbers that are not finite, a direction or max_distance of zero, a negative
            max_distance or a body of another world; StateError before `build`.
        Example:
            hit = world.raycast(origin=(0, 0, 5), direction=(0, 0, -1), max_distance=10)
            if hit is not None:
                print(hit.body, hit.distance, hit.normal)
        """
        state, slots = self._built.state, self._context.slots.slots
        return cast_ray(state, slots, origin, direction, max_distance, bodies, cull_back)

    def raycasts(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        cull_back: bool = True,
    ) -> RayHits:
        """Find the first hits of many rays in one call, on all threads.

        Args:
            origins, directions: starts [m] and directions of the rays, (n, 3) each.
            max_distance, bodies, cull_back: as in `raycast`, for all rays.
        Returns: the results of `raycast` as arrays with one row per ray.
        Raises: as `raycast`.
        """
        state, slots = self._built.state, self._context.slots.slots
        return cast_rays(state, slots, origins, directions, max_distance, bodies, cull_back)

    def closest_point(
        self, point: ArrayLike, *, max_distance: float = math.inf, bodies: Iterable[Body] | None = None
    ) -> ClosestPoint | None:
        """Find the point of all surfaces that is closest to `point`, which can be outside or inside a body.

        For a body without triangles, such as a rope, only the vertices are searched.
        Args:
            point: point to search from, (3,) [m].
            max_distance: largest distance [m]; infinity for no limit.
            bodies: bodies to test; None for all.
        Returns: the closest point, or None if no point is in range.
        Raises: OptionError for numbers that are not finite, a max_distance that is not above 0 or a body of
            another world; StateError before `build`.
        """
        return find_closest_point(self._built.state, self._context.slots.slots, point, max_distance, bodies)

    def overlap_sphere(
        self, center: ArrayLike, radius: float, *, bodies: Iterable[Body] | None = None
    ) -> tuple[Overlap, ...]:
        """Find the bodies that touch or enclose a sphere.

        For a body without triangles, only the vertices are tested.
        Args:
            center: centre of the sphere, (3,) [m].
            radius: radius of the sphere [m], above 0.
            bodies: bodies to test; None for all.
        Returns: the bodies, in the world's order, each with its vertices that are inside the sphere.
        Raises: OptionError for numbers that are not finite, a radius not above 0 or a body of another world;
            StateError before `build`.
        """
        return find_in_sphere(self._built.state, self._context.slots.slots, center, radius, bodies)

    def overlap_box(
        self,
        center: ArrayLike,
        size: ArrayLike,
        rotation: ArrayLike | None = None,
        *,
        bodies: Iterable[Body] | None = None,
    ) -> tuple[Overlap, ...]:
        """Find the bodies that touch or enclose a box.

        For a body without triangles, only the vertices are tested.
        Args:
            center: centre of the box, (3,) [m].
            size: lengths of the edges of the box, (3,) [m], above 0.
            rotation: rotation about the centre, matrix (3, 3) or quaternion (x, y, z, w).
            bodies: bodies to test; None for all.
        Returns: the bodies, in the world's order, each with its vertices that are inside the box.
        Raises: OptionError for numbers that are not finite, a size not above 0, an invalid rotation or a body
            of another world; StateError before `build`.
        """
        return find_in_box(self._built.state, self._context.slots.slots, center, size, rotation, bodies)
