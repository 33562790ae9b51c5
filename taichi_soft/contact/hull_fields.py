"""The Taichi fields of hulls. A hull is a contact surface that replaces the surface of a body's tetrahedra.

If any body of a world has a hull, these fields contain the contact surfaces of all bodies. For a body without
a hull, this is the surface of its tetrahedra. The points of a hull are additional rows of the particle
fields, after the particles of its body. Contact reads the positions of hull points like those of particles,
and applies impulses and displacements to the particles that carry the points.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.layout import BodyArrays, Ranges, Scene
from taichi_soft.contact.fields import SLOTS
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import BODY, FEATURE, LOADED, OUTER, PARTICLE, TRIANGLE, FieldGroup, declare
from taichi_soft.core.runtime import ti

TOUCHES = 4
"""Maximum number of colliders that a hull point can touch in a substep."""


class HullFields(FieldGroup):
    """Contact surfaces, and the carriers of their points. Four particles carry a hull point.

    A particle is a point that carries itself.
    """

    owner, when = "contact", "has_hulls"
    # Same meaning as the fields of the same names in `BodyFields`.
    body_outer = declare(BODY, ti.i32, 2, start=LOADED)
    body_triangles = declare(BODY, ti.i32, 2, start=LOADED)
    outer_particle = declare(OUTER, ti.i32, start=LOADED)
    triangle_vertices = declare(TRIANGLE, ti.i32, 3, start=LOADED)
    body_points = declare(BODY, ti.i32, 2, start=LOADED)  # range of hull points; empty without a hull
    carriers = declare(PARTICLE, ti.i32, 4, start=LOADED)
    weights = declare(PARTICLE, ti.f32, 4, start=LOADED)
    # Contacts of hull points with colliders in a substep, without gaps for each body. The number is 0 outside
    # a substep, and until the contacts are listed.
    touch_count = declare(BODY, ti.i32, start=0)
    touch_point = declare(OUTER, ti.i32, each=TOUCHES)
    touch_collider = declare(OUTER, ti.i32, each=TOUCHES)
    touch_normal = declare(OUTER, ti.f32, 3, each=TOUCHES)  # normal of the collider's surface
    touch_surface = declare(OUTER, ti.f32, 3, unit="m/s", each=TOUCHES)  # velocity of that surface
    # Smallest allowed speed of the point along the normal, relative to the surface.
    touch_allowed = declare(OUTER, ti.f32, unit="m/s", each=TOUCHES)
    # Signed distance from the surface at the end of the path that starts at `touch_start` with
    # `touch_start_velocity`.
    touch_beyond = declare(OUTER, ti.f32, unit="m", each=TOUCHES)
    touch_start = declare(OUTER, ti.f32, 3, unit="m", each=TOUCHES)
    touch_start_velocity = declare(OUTER, ti.f32, 3, unit="m/s", each=TOUCHES)
    touch_inv_mass = declare(OUTER, ti.f32, unit="1/kg", each=TOUCHES)  # inverse mass of the point
    touch_normal_impulse = declare(OUTER, ti.f32, unit="N s", each=TOUCHES)  # impulse on the point
    touch_friction_impulse = declare(OUTER, ti.f32, 3, unit="N s", each=TOUCHES)
    # Indices plus 1 of up to two colliders that a point touched in the last substep; 0 for none. The fields
    # below contain the impulses of these colliders on the point, and are undefined without a collider.
    held_by = declare(PARTICLE, ti.i32, 2, start=0, keep=PARTICLE)
    held_normal_impulse = declare(PARTICLE, ti.f32, 2, unit="N s", keep=PARTICLE)
    held_friction_impulse = declare(PARTICLE, ti.f32, 3, unit="N s", keep=PARTICLE)
    held_second_friction_impulse = declare(PARTICLE, ti.f32, 3, unit="N s", keep=PARTICLE)
    # For each contact between bodies: speed that an impulse of 1 N s at one point gives to each point.
    slot_mobility = declare(FEATURE, ti.f32, (4, 4), unit="1/kg", each=SLOTS, when="has_soft_contact")

    @property
    def held_impulses(self) -> list[Any]:
        """Fields of the impulses from which the contact solver starts in a substep."""
        return [self.held_normal_impulse, self.held_friction_impulse, self.held_second_friction_impulse]

    def load(self, loader: Loader, scene: Scene) -> None:
        """Fill the fields from `scene`."""
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


def touching_rows(
    body: BodyArrays, place: Ranges
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
    """Return the contact surface of a body. Indices count from the first particle of the body.

    Returns: particles, (k,); triangles, (t, 3); carriers of the hull points, (h, 4); weights of the carriers,
    (h, 4).
    """
    hull = body.hull
    if hull is None:
        carriers, weights = np.zeros((0, 4), dtype=np.int32), np.zeros((0, 4), dtype=np.float32)
        return body.outer.astype(np.int32), body.triangles.astype(np.int32), carriers, weights
    count = len(hull.vertices)
    first = place.particles[1] - place.particles[0] - count
    rows = np.arange(first, first + count, dtype=np.int32)
    weights = hull.weights.astype(np.float32)
    return rows, rows[hull.triangles], hull.vertices.astype(np.int32), weights
