"""Methods of a world for raycasts, shape casts, closest points and overlaps."""

from __future__ import annotations

import math
from collections.abc import Iterable

from numpy.typing import ArrayLike

from taichi_soft.contact.shapes import BoxShape, CapsuleShape, SphereShape
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.queries import (
    ChosenColliders,
    ClosestPoint,
    Overlap,
    RayHit,
    RayHits,
    ShapeHit,
    cast_ray,
    cast_rays,
    cast_shape,
    find_closest_point,
    find_in_box,
    find_in_sphere,
    targets_of,
)
from taichi_soft.world.body import Body
from taichi_soft.world.world_parts import WorldParts


class WorldQueries(WorldParts):
    """Methods of a world that search the surfaces of its bodies and colliders."""

    def raycast(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        colliders: ChosenColliders = False,
        mask: int = ALL_GROUPS,
        cull_back: bool = True,
    ) -> RayHit | None:
        """Find the first hit of a ray on the deformed surfaces after the last step, and on colliders.

        Bodies without triangles, such as ropes, cannot be hit. If several triangles are equally near, the hit
        is on the first triangle of the first body; a collider is hit if it is nearer than all bodies. All
        queries include frozen bodies. They use the current poses of colliders, and their surfaces without
        thickness.
        Args:
            origin: start of the ray, (3,) [m].
            direction: direction of the ray, (3,), of any nonzero length.
            max_distance: largest distance of a hit [m]; infinity for no limit.
            bodies: bodies to test; None for all, an empty list for none.
            colliders: colliders to test; True for all, False for none.
            mask: groups of the bodies and colliders to test, as bits.
            cull_back: True ignores back faces, so that a ray from inside a body leaves the body. A ray from
                inside a collider always leaves the collider.
        Returns: the hit, or None.
        Raises: OptionError for numbers that are not finite, a direction or max_distance of zero, a negative
            max_distance, an invalid mask, or a body or collider of another world; StateError before `build`,
            and for colliders with schedule "flat".
        Example:
            hit = world.raycast(origin=(0, 0, 5), direction=(0, 0, -1), max_distance=10)
            if hit is not None:
                print(hit.body, hit.distance, hit.normal)
            wall = world.raycast((0, 0, 5), (0, 0, -1), bodies=[], colliders=True)
        """
        targets = targets_of(self._context, bodies, colliders, mask)
        return cast_ray(targets, origin, direction, max_distance, cull_back)

    def raycasts(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        colliders: ChosenColliders = False,
        mask: int = ALL_GROUPS,
        cull_back: bool = True,
    ) -> RayHits:
        """Find the first hits of many rays in one call, on all threads.

        Args:
            origins, directions: starts [m] and directions of the rays, (n, 3) each.
            max_distance, bodies, colliders, mask, cull_back: as in `raycast`, for all rays.
        Returns: the results of `raycast` as arrays with one row per ray.
        Raises: as `raycast`.
        """
        targets = targets_of(self._context, bodies, colliders, mask)
        return cast_rays(targets, origins, directions, max_distance, cull_back)

    def shapecast(
        self,
        shape: SphereShape | CapsuleShape | BoxShape,
        position: ArrayLike,
        direction: ArrayLike,
        *,
        rotation: ArrayLike | None = None,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        colliders: ChosenColliders = True,
        mask: int = ALL_GROUPS,
    ) -> ShapeHit | None:
        """Move a shape along a line, and find the first surface that it touches.

        The shape does not rotate, and nothing is moved. A shape that overlaps a surface at the start touches
        it at the distance 0 if the motion leads deeper; surfaces that the shape leaves or slides along are
        ignored. Ropes are touched at their vertices only.
        Args:
            shape: `SphereShape`, `CapsuleShape` or `BoxShape`.
            position: position of the shape's centre at the start, (3,) [m].
            direction: direction of the motion, (3,), of any nonzero length.
            rotation: rotation of the shape, matrix (3, 3) or quaternion (x, y, z, w).
            max_distance: largest distance of the motion [m]; infinity for no limit.
            bodies, colliders, mask: see `raycast`. All are tested by default.
        Returns: the first touch, or None.
        Raises: OptionError for another shape, numbers that are not finite, a direction or max_distance of
            zero, a negative max_distance, an invalid rotation or mask, or a body or collider of another
            world; StateError before `build`, and for colliders with schedule "flat".
        Example:
            step = world.shapecast(BoxShape((0.6, 0.6, 1.6)), (0, 0, 5), (0, 0, -1), max_distance=10)
            if step is not None:
                print(step.distance, step.normal, step.body or step.collider)
        """
        targets = targets_of(self._context, bodies, colliders, mask)
        return cast_shape(targets, shape, position, direction, rotation, max_distance)

    def closest_point(
        self,
        point: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        colliders: ChosenColliders = False,
        mask: int = ALL_GROUPS,
    ) -> ClosestPoint | None:
        """Find the point of all surfaces that is closest to `point`, which can be outside or inside a body.

        For a body without triangles, such as a rope, only the vertices are searched.
        Args:
            point: point to search from, (3,) [m].
            max_distance: largest distance [m]; infinity for no limit.
            bodies, colliders, mask: see `raycast`.
        Returns: the closest point, or None if no point is in range.
        Raises: OptionError for numbers that are not finite, a max_distance that is not above 0, an invalid
            mask, or a body or collider of another world; StateError before `build`, and for colliders with
            schedule "flat".
        """
        targets = targets_of(self._context, bodies, colliders, mask)
        return find_closest_point(targets, point, max_distance)

    def overlap_sphere(
        self,
        center: ArrayLike,
        radius: float,
        *,
        bodies: Iterable[Body] | None = None,
        mask: int = ALL_GROUPS,
    ) -> tuple[Overlap, ...]:
        """Find the bodies that touch or enclose a sphere.

        For a body without triangles, only the vertices are tested.
        Args:
            center: centre of the sphere, (3,) [m].
            radius: radius of the sphere [m], above 0.
            bodies, mask: see `raycast`.
        Returns: the bodies, in the world's order, each with its vertices that are inside the sphere.
        Raises: OptionError for numbers that are not finite, a radius not above 0, an invalid mask or a body
            of another world; StateError before `build`.
        """
        return find_in_sphere(targets_of(self._context, bodies, mask=mask), center, radius)

    def overlap_box(
        self,
        center: ArrayLike,
        size: ArrayLike,
        rotation: ArrayLike | None = None,
        *,
        bodies: Iterable[Body] | None = None,
        mask: int = ALL_GROUPS,
    ) -> tuple[Overlap, ...]:
        """Find the bodies that touch or enclose a box.

        For a body without triangles, only the vertices are tested.
        Args:
            center: centre of the box, (3,) [m].
            size: lengths of the edges of the box, (3,) [m], above 0.
            rotation: rotation about the centre, matrix (3, 3) or quaternion (x, y, z, w).
            bodies, mask: see `raycast`.
        Returns: the bodies, in the world's order, each with its vertices that are inside the box.
        Raises: OptionError for numbers that are not finite, a size not above 0, an invalid rotation or mask,
            or a body of another world; StateError before `build`.
        """
        return find_in_box(targets_of(self._context, bodies, mask=mask), center, size, rotation)
