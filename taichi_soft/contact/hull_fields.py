"""The Taichi fields of hulls: what touches of each body, in place of the surface of its tetrahedra.

In a world where any body has a hull these fields are all bodies' touching surfaces. A body without a hull has
its own there. The points of a hull are rows of the particles' fields, behind those of its body: contact reads
their places as those of particles, and passes on to the particles that carry them what it does to them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene
from taichi_soft.contact.fields import SLOTS
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.runtime import holds_fields, ti

TOUCHES = 4
"""Colliders that a point of a hull may meet in a substep."""


@holds_fields
class HullFields:
    """Touching surfaces, and what carries each particle that touches: itself, or of a hull's point four."""

    def __init__(self, particles: int, bodies: int, outer: int, triangles: int, *, soft: bool) -> None:
        """Allocate; contents are zero."""
        # As those of the same names in `BodyFields`.
        self.body_outer = ti.Vector.field(2, ti.i32, bodies)
        self.body_triangles = ti.Vector.field(2, ti.i32, bodies)
        self.outer_particle = ti.field(ti.i32, outer)
        self.triangle_vertices = ti.Vector.field(3, ti.i32, triangles)
        self.body_points = ti.Vector.field(2, ti.i32, bodies)  # rows of the points; none without a hull
        self.carriers = ti.Vector.field(4, ti.i32, particles)
        self.weights = ti.Vector.field(4, ti.f32, particles)
        # Contacts with colliders in a substep, of each body from its first one on: normal of the collider,
        # how fast it is there, how fast the point may be along the normal beside it [m/s]; how far behind the
        # surface its way would end [m] that began at the place [m] with the velocity [m/s].
        touches = TOUCHES * outer
        self.touch_point = ti.field(ti.i32, touches)
        self.touch_collider = ti.field(ti.i32, touches)
        self.touch_normal = ti.Vector.field(3, ti.f32, touches)
        self.touch_surface = ti.Vector.field(3, ti.f32, touches)
        self.touch_allowed = ti.field(ti.f32, touches)
        self.touch_beyond = ti.field(ti.f32, touches)
        self.touch_start = ti.Vector.field(3, ti.f32, touches)
        self.touch_start_velocity = ti.Vector.field(3, ti.f32, touches)
        self.touch_inv_mass = ti.field(ti.f32, touches)  # of the point [1/kg]
        self.touch_normal_impulse = ti.field(ti.f32, touches)  # on the point [N s]
        self.touch_friction_impulse = ti.Vector.field(3, ti.f32, touches)
        # Of each point: two colliders that it touched in the last substep, counted from 1, or 0, and their
        # impulses on it [N s].
        self.held_by = ti.Vector.field(2, ti.i32, particles)
        self.held_normal_impulse = ti.Vector.field(2, ti.f32, particles)
        self.held_friction_impulse = ti.Vector.field(3, ti.f32, particles)
        self.held_second_friction_impulse = ti.Vector.field(3, ti.f32, particles)
        if soft:
            # Of each contact: how fast an impulse of 1 N s at one corner of the triangle makes another [m/s].
            self.slot_mobility = ti.Matrix.field(3, 3, ti.f32, outer * SLOTS)

    def carried(self) -> list[Any]:
        """What the next step depends on, of each particle."""
        return [self.held_by, *self.held_impulses]

    @property
    def held_impulses(self) -> list[Any]:
        """Fields of the impulses that a substep begins with."""
        return [self.held_normal_impulse, self.held_friction_impulse, self.held_second_friction_impulse]

    def load(self, loader: Loader, scene: Scene) -> None:
        """Fill from `scene`."""
        points, outer, triangles = [], np.zeros(scene.outer_count), np.zeros((scene.triangle_count, 3))
        used_outer, used_triangles = [], []
        carriers = np.repeat(np.arange(self.carriers.shape[0])[:, None], 4, axis=1)
        weights = np.zeros((len(carriers), 4))
        weights[:, 0] = 1.0
        for body, place in zip(scene.bodies, scene.ranges, strict=True):
            own = touching_rows(body, place)
            (p0, p1), (o0, _), (t0, _) = place.particles, place.outer, place.triangles
            points.append((p1 - len(own[2]), p1))
            used_outer.append((o0, o0 + len(own[0])))
            used_triangles.append((t0, t0 + len(own[1])))
            outer[slice(*used_outer[-1])] = own[0] + p0
            triangles[slice(*used_triangles[-1])] = own[1] + p0
            carriers[slice(*points[-1])], weights[slice(*points[-1])] = own[2] + p0, own[3]
        loader.fill(self.body_outer, np.array(used_outer))
        loader.fill(self.body_triangles, np.array(used_triangles))
        loader.fill(self.outer_particle, outer)
        loader.fill(self.triangle_vertices, triangles)
        loader.fill(self.body_points, np.array(points))
        loader.fill(self.carriers, carriers)
        loader.fill(self.weights, weights)
        loader.fill(self.held_by, np.zeros((0, 2)))


def touching_rows(
    body: BodyArrays, place: Ranges
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """What touches of a body, counted from its first particle: particles (k,), triangles (t, 3); and of the
    points of its hull the carriers (h, 4) and their weights (h, 4)."""
    hull = body.hull
    if hull is None:
        carriers, weights = np.zeros((0, 4), dtype=np.int32), np.zeros((0, 4), dtype=np.float32)
        return body.outer.astype(np.int32), body.triangles.astype(np.int32), carriers, weights
    count = len(hull.vertices)
    first = place.particles[1] - place.particles[0] - count
    rows = np.arange(first, first + count, dtype=np.int32)
    weights = hull.weights.astype(np.float32)
    return rows, rows[hull.triangles], hull.vertices.astype(np.int32), weights
