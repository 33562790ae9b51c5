"""The Taichi fields of contact between the faces of bodies and colliders.

The faces of a body are the triangles of its contact surface and their edges; of a rope, its edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.layout import Scene
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import BODY, LOADED, OUTER, PARTICLE, TRIANGLE, FieldGroup, declare
from taichi_soft.core.runtime import ti

FACES = 6
"""Number of faces near colliders that are listed, and of their contacts, per particle of a surface. A closed
surface has two triangles and three edges per particle."""

PARTS, INSIDE = 4, 3
"""Number of parts of a triangle, and the last of them. The first three are its edges."""


class FaceFields(FieldGroup):
    """Faces near colliders, and their contacts in a substep."""

    owner, when = "contact", "has_contact"
    # Bits of the parts of a triangle that no earlier triangle has. Each edge counts once, and each triangle
    # of a sheet. 0 if the body touches with its vertices only.
    own_parts = declare(TRIANGLE, ti.i32, start=LOADED)
    near_count = declare(BODY, ti.i32, start=0)
    # PARTS times the triangle, plus the part; for a body without triangles, PARTS times the edge.
    near_face = declare(OUTER, ti.i32, each=FACES)
    clearance = declare(OUTER, ti.f32, unit="m", each=FACES)  # as `particle_clearance`, without planes
    # Collider of the last search, or -1, and a plane between it and the face: see `triangle_sweep.is_behind`.
    plane_collider = declare(OUTER, ti.i32, each=FACES)
    plane = declare(OUTER, ti.f32, 4, each=FACES)
    start = declare(PARTICLE, ti.f32, 3, unit="m")  # position at the start of the substep
    # Contacts of a body in a substep, without gaps.
    points = declare(OUTER, ti.i32, 3, each=FACES)
    weights = declare(OUTER, ti.f32, 3, each=FACES)  # barycentric coordinates of the point in contact
    collider = declare(OUTER, ti.i32, each=FACES)
    normal = declare(OUTER, ti.f32, 3, each=FACES)  # from the collider to the body
    surface = declare(OUTER, ti.f32, 3, unit="m/s", each=FACES)  # velocity of the collider's surface
    # Smallest allowed speed of the point along the normal, relative to the surface.
    allowed = declare(OUTER, ti.f32, unit="m/s", each=FACES)
    # Position of the point on the surface at the end of the substep, and time from the touch to this end.
    anchor = declare(OUTER, ti.f32, 3, unit="m", each=FACES)
    time_left = declare(OUTER, ti.f32, unit="s", each=FACES)
    inv_mass = declare(OUTER, ti.f32, unit="1/kg", each=FACES)
    normal_impulse = declare(OUTER, ti.f32, unit="N s", each=FACES)
    friction_impulse = declare(OUTER, ti.f32, 3, unit="N s", each=FACES)

    def load(self, loader: Loader, scene: Scene) -> None:
        """Fill the fields from `scene`."""
        parts = np.full(scene.triangle_count, 2**PARTS - 1, dtype=np.int32)
        for body, place in zip(scene.bodies, scene.ranges, strict=True):
            triangles = body.triangles if body.hull is None else body.hull.triangles
            first = place.triangles[0]
            if not body.has_faces:
                parts[slice(*place.triangles)] = 0
            elif place.triangles[1] - first == len(triangles):  # a cut makes other triangles
                parts[slice(*place.triangles)] = _own_parts(triangles)
        loader.fill(self.own_parts, parts)


def _own_parts(triangles: NDArray[np.integer]) -> NDArray[np.int32]:
    """Return the bits of the parts of each triangle that no triangle before it has, (f,)."""
    parts = np.zeros(len(triangles), dtype=np.int32)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 3, 2), axis=2).reshape(-1, 2)
    _, first = np.unique(edges, axis=0, return_index=True)
    np.bitwise_or.at(parts, first // 3, 1 << first % 3)
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    parts[first] |= 1 << INSIDE
    return parts
