"""Questions to a world: what a ray hits, what is near."""

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
    """What of a world answers questions."""

    def raycast(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        cull_back: bool = True,
    ) -> RayHit | None:
        """The first hit of a ray on the deformed surfaces, as they are after the last step.

        Ropes and other bodies without triangles cannot be hit. Of equally near triangles the one of the first
        body, and there the first, counts. Frozen bodies are asked too; this goes for all queries.
        Args:
            origin: (3,) [m].
            direction: (3,), of any length but zero.
            max_distance: a hit farther than this [m] is none; infinity for no limit.
            bodies: that can be hit; None for all.
            cull_back: pass through triangles seen from behind, so that a ray from inside a body leaves it
                unhindered.
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
        """The first hits of many rays in one go, on all threads.

        Args:
            origins, directions: (n, 3) each.
            max_distance, bodies, cull_back: as in `raycast`, for all rays.
        Returns: arrays with a row for each ray, the same as `raycast` finds.
        Raises: as `raycast`.
        """
        state, slots = self._built.state, self._context.slots.slots
        return cast_rays(state, slots, origins, directions, max_distance, bodies, cull_back)

    def closest_point(
        self, point: ArrayLike, *, max_distance: float = math.inf, bodies: Iterable[Body] | None = None
    ) -> ClosestPoint | None:
        """The point of all surfaces that is nearest to `point`, from outside or from inside.

        Of a body without triangles (a rope) its vertices are asked.
        Args:
            point: (3,) [m].
            max_distance: what is farther [m] does not count; infinity for no limit.
            bodies: to ask; None for all.
        Returns: the nearest point, or None where nothing is near enough.
        Raises: OptionError for numbers that are not finite, a max_distance that is not above 0 or a body of
            another world; StateError before `build`.
        """
        return find_closest_point(self._built.state, self._context.slots.slots, point, max_distance, bodies)

    def overlap_sphere(
        self, center: ArrayLike, radius: float, *, bodies: Iterable[Body] | None = None
    ) -> tuple[Overlap, ...]:
        """Bodies that touch a sphere or enclose it; of a body without triangles its vertices count.

        Args:
            center: (3,) [m].
            radius: above 0 [m].
            bodies: to ask; None for all.
        Returns: the bodies, in the world's order, each with its vertices in the sphere.
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
        """Bodies that touch a box or enclose it; of a body without triangles its vertices count.

        Args:
            center: (3,) [m].
            size: (3,) lengths of its edges, above 0 [m].
            rotation: about its centre, matrix (3, 3) or quaternion (x, y, z, w).
            bodies: to ask; None for all.
        Returns: the bodies, in the world's order, each with its vertices in the box.
        Raises: OptionError for numbers that are not finite, a size not above 0, what is no rotation or a body
            of another world; StateError before `build`.
        """
        return find_in_box(self._built.state, self._context.slots.slots, center, size, rotation, bodies)
