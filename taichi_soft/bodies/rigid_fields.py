"""The Taichi fields of rigid bodies: pose, motion and inertia.

A rigid body has four particles, see `RigidMesh`. Between steps, positions and velocities of the particles are
the state of the body. In a substep, forces act on the particles. Then the body has the rigid motion with
their momentum and angular momentum, on which contact acts, and the particles follow this motion.
"""

from __future__ import annotations

import numpy as np

from taichi_soft.bodies.layout import Scene
from taichi_soft.core.field_loader import Loader
from taichi_soft.core.field_table import BODY, FINITE, LOADED, FieldGroup, declare
from taichi_soft.core.runtime import ti


class RigidFields(FieldGroup):
    """Rigid bodies. `radii` is zero for a body that can deform; its other fields are not used."""

    owner, when = "bodies", "has_rigid"
    # Root mean square of the solid's coordinates along its principal axes, the largest first.
    radii = declare(BODY, ti.f32, 3, unit="m", start=LOADED)
    corners = declare(BODY, ti.i32, 4, start=LOADED)  # the particles, in the order of `SIGNS`
    # The pose from which the particles are placed, relative to the body's origin. Particles that something
    # else has moved replace it.
    center = declare(BODY, ti.f32, 3, unit="m", start=0, keep=BODY, most=FINITE)
    rotation = declare(BODY, ti.f32, 4, start=0, keep=BODY, most=FINITE)  # quaternion, from principal axes
    prev_center = declare(BODY, ti.f32, 3, unit="m")
    prev_rotation = declare(BODY, ti.f32, 4)
    prev_residue = declare(BODY, ti.f32, 3, unit="m^2/s")
    # Motion after the kick of this substep, and inertia in this pose. Both inverses are 0 if the body is
    # pinned or does not move.
    velocity = declare(BODY, ti.f32, 3, unit="m/s")
    spin = declare(BODY, ti.f32, 3, unit="rad/s")
    angular = declare(BODY, ti.f32, 3, unit="m^2/s")  # angular momentum about the centre, divided by the mass
    # Rounding error of `angular` after the velocities of the particles are stored. `gather_motion` adds it
    # again. Otherwise, a spinning body would gain or lose angular momentum.
    residue = declare(BODY, ti.f32, 3, unit="m^2/s", start=0, keep=BODY, most=FINITE)
    inv_mass = declare(BODY, ti.f32, unit="1/kg")
    inv_inertia = declare(BODY, ti.f32, (3, 3), unit="1/(kg m^2)")

    def load(self, loader: Loader, scene: Scene) -> None:
        """Fill the fields from `scene`."""
        radii, corners = np.zeros((len(scene.bodies), 3)), np.zeros((len(scene.bodies), 4), dtype=np.int32)
        for row, (body, place) in enumerate(zip(scene.bodies, scene.ranges, strict=True)):
            if body.radii is not None:
                radii[row], corners[row] = body.radii, body.rank[:4] + place.particles[0]
        loader.fill(self.radii, radii)
        loader.fill(self.corners, corners)
