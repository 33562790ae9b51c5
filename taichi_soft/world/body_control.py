"""Methods that change one body."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.bodies.status import SHELTERED
from taichi_soft.contact.filters import filter_of, set_filter
from taichi_soft.control.attachments import Attachment, attach
from taichi_soft.control.drives import (
    apply_force,
    set_gravity_scale,
    set_linear_damping,
    set_sheltered,
)
from taichi_soft.control.frames import Frame
from taichi_soft.control.frictions import set_friction
from taichi_soft.control.grabs import Grab, grab_at
from taichi_soft.control.impulses import apply_impulse, apply_impulse_at_point
from taichi_soft.control.joints import Joint, Joints
from taichi_soft.control.materials import set_damping, set_material
from taichi_soft.control.pins import pin, set_targets, unpin
from taichi_soft.control.rigid_motion import set_velocity, teleport
from taichi_soft.core.handles import recorded
from taichi_soft.elements.materials import AnyMaterial

Floats32 = NDArray[np.float32]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class BodyControl(SoftBody):
    """Methods that change a body."""

    @recorded
    def apply_force(self, force: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Apply a force during the next step, with the same acceleration for all given particles.

        Further calls before the step add their forces.
        Args:
            force: total force, (3,) [N]. Pins absorb the part of the force on pinned particles.
            particles: particles on which the force acts; None means all.
        Raises: OptionError for invalid numbers or vertices; StateError before `build` and with schedule
            "flat".
        """
        apply_force(self, force, particles)

    @recorded
    def set_gravity_scale(self, scale: float) -> None:
        """Set the factor on gravity for this body. With 0 the body floats, with -1 it rises.

        Args:
            scale: factor on the gravity of the world; 1 in a new body.
        """
        set_gravity_scale(self, scale)

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the friction between this body and other bodies from the next step on.

        The floor and other colliders have their own friction, see `World.set_friction` and
        `Collider.set_friction`.
        Args:
            friction: Coulomb coefficient of the body's `Contact`, 0 or more.
        Raises: OptionError for a number out of range; StateError before `build`, and in a world without
            `soft_contact`.
        """
        set_friction(self, friction)

    @property
    def group(self) -> int:
        """Groups of the body, as bits."""
        return filter_of(self)[0]

    @property
    def mask(self) -> int:
        """Groups that the body touches, as bits."""
        return filter_of(self)[1]

    @recorded
    def set_filter(self, group: int, mask: int) -> None:
        """Change what the body touches, from the next step on.

        Contacts with what it no longer touches end at once. If it overlaps a body that it now touches, the
        two are moved apart. The body and sleeping bodies near it wake.
        Args:
            group, mask: groups as bits, see `Contact`.
        Raises: OptionError for a value that is no bit field; StateError before `build` and with schedule
            "flat".
        """
        set_filter(self, group, mask)

    @property
    def linear_damping(self) -> float:
        """Damping rate of all velocities of the body [1/s]; 0 by default."""
        simulation = self._context.fields
        return 0.0 if simulation is None else float(simulation.state.body_damping[self.index])

    @property
    def is_sheltered(self) -> bool:
        """True if the body is sheltered from the wind."""
        simulation = self._context.fields
        drives = 0 if simulation is None else int(simulation.state.body_drives[self.index])
        return bool(drives & SHELTERED)

    @recorded
    def set_linear_damping(self, rate: float) -> None:
        """Make all velocities of the body decay with exp(-rate t), including those of rigid motion.

        Args:
            rate: damping rate [1/s], 0 or more; 0 in a new body.
        Raises: OptionError for a negative rate; StateError before `build` and with schedule "flat".
        """
        set_linear_damping(self, rate)

    @recorded
    def set_sheltered(self, is_sheltered: bool) -> None:
        """Shelter the body from the wind of `World.set_wind`, or expose the body to it.

        Args:
            is_sheltered: True shelters the body. A new body is not sheltered.
        """
        set_sheltered(self, is_sheltered)

    @recorded
    def apply_impulse(self, impulse: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Change the momentum at once. All given particles get the same change of velocity.

        Args:
            impulse: total impulse, (3,) [N s]. Pins absorb the part of the impulse on pinned particles.
            particles: particles on which the impulse acts; None means all.
        Raises: OptionError for invalid numbers or vertices; StateError before `build`.
        Example:
            body.apply_impulse((0, 0, 2.0 * body.masses.sum()))  # 2 m/s upwards
        """
        apply_impulse(self, impulse, particles)

    @recorded
    def apply_impulse_at_point(self, impulse: ArrayLike, point: ArrayLike, radius: float) -> None:
        """Apply an impulse to the particles near a point. The change of velocity falls off with the distance
        r as (1 - (r/radius)^2)^2.

        Args:
            impulse: total impulse on all particles within range, (3,) [N s].
            point: centre, (3,) [m].
            radius: range of the impulse [m].
        Raises: as `apply_impulse`; OptionError with the smallest distance if no particle is in range.
        """
        apply_impulse_at_point(self, impulse, point, radius)

    @recorded
    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Set the velocities of all free particles to those of a rigid motion. Pinned particles do not
        change.

        Args:
            linear: velocity of the centre of mass, (3,) [m/s].
            angular: angular velocity about the centre of mass, (3,) [rad/s].
        Raises: OptionError for invalid numbers; StateError before `build`.
        """
        set_velocity(self, linear, angular)

    @recorded
    def teleport(
        self, position: ArrayLike, rotation: ArrayLike | None = None, *, keep_velocity: bool = True
    ) -> None:
        """Move the whole body at once, with its current deformation.

        Interpolated frames and the targets of pins jump with the body.

        Args:
            position: new position of the centre of mass, (3,) [m].
            rotation: rotation about the centre of mass from its current orientation, matrix or quaternion
                (x, y, z, w).
            keep_velocity: True rotates the velocities with the body, False stops the body.
        Raises: OptionError for invalid numbers, or if the body would be below the floor or inside a collider;
            StateError before `build`.
        """
        teleport(self, position, rotation, keep_velocity)

    @recorded
    def pin(self, particles: ArrayLike) -> None:
        """Pin particles at their positions.

        Args:
            particles: vertices of this body.
        Raises: OptionError for invalid vertices; StateError before `build`, and for attached vertices.
        Example:
            left = np.flatnonzero(body.mesh.vertices[:, 0] < -0.24)
            body.pin(left)
            world.step(1 / 60)
            body.unpin(left)
        """
        pin(self, particles)

    @recorded
    def unpin(self, particles: ArrayLike | None = None) -> None:
        """Release pinned particles. They keep the velocity of their last motion.

        Args:
            particles: vertices of this body; None, the default, means all.
        """
        unpin(self, particles)

    @recorded
    def set_targets(self, particles: ArrayLike, positions: ArrayLike) -> None:
        """Move pinned particles in a straight line to `positions` over the next step.

        Afterwards, the particles stay at these positions until they get new targets.
        Args:
            particles: pinned vertices, (n,).
            positions: targets, (n, 3) [m].
        Raises: OptionError for wrong shapes; StateError for a particle that is not pinned.
        """
        set_targets(self, particles, positions)

    @recorded
    def attach(
        self,
        particles: ArrayLike,
        frame: Frame,
        *,
        two_way: bool = False,
        break_force: float | None = None,
    ) -> Attachment:
        """Attach particles to a frame, at their current positions relative to the frame.

        Args:
            particles: vertices of this body; pinned vertices are allowed.
            frame: frame of the same world.
            two_way: True records the load on the frame: `Attachment.force` and `Attachment.torque`.
            break_force: with `two_way`, mean force during a step above which the attachment breaks [N]: it is
                released after that step, with an event `Broke`. None: it never breaks.
        Raises: OptionError for a frame of another world, and for a break_force that is not above 0 or without
            `two_way`; StateError for a particle that is already attached, and for `two_way` with schedule
            "flat".
        """
        return attach(self, particles, frame, two_way, break_force)

    @recorded
    def attach_to(
        self,
        other: SoftBody,
        particles: ArrayLike,
        *,
        onto: ArrayLike | None = None,
        break_force: float | None = None,
    ) -> Joint:
        """Attach particles of this body to another body, until `Joint.release`.

        The joined parts then move together, for any masses and stiffnesses. Action equals reaction, so
        momentum and angular momentum are conserved. A gap, for example after `teleport`, closes only as fast
        as the bodies can follow. There is no contact between the joined parts; with `soft_contact` the rest
        of the two bodies collides. Joined bodies sleep and wake together. `World.despawn` of one of the
        two bodies removes the joint. If one body is frozen, it holds the other body in place.
        Args:
            other: another body of the same world, with tetrahedra unless `onto` is given.
            particles: vertices of this body, preferably of the finer mesh.
            onto: vertices of `other` to which the particles are attached, one per particle. None attaches
                each particle at its current position, which must be in a tetrahedron of `other` or just
                outside it.
            break_force: mean force during a step above which the joint breaks [N]: it is released after that
                step, with an event `Broke`. None: it never breaks.
        Raises: OptionError for this body or a body of another world, for invalid vertices, for a break_force
            that is not above 0, and without `onto` for vertices that are too far away; StateError before
            `build`, in a world without contact, with implicit Euler, and if the world's 64 joints, or their
            2,048 particles, are all in use.
        Example:
            rider = world.spawn(ball, position=(0, 0, 0.8))
            lowest = rider.positions()[:, 2].argsort()[:4]
            joint = rider.attach_to(body, lowest)
            world.step(1 / 60)
            joint.release()
        """
        return self._context.of(Joints).join(self, other, particles, onto, break_force)

    @recorded
    def grab(
        self,
        triangle: int,
        barycentrics: ArrayLike = (1 / 3, 1 / 3, 1 / 3),
        *,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab:
        """Grab the surface with a critically damped spring.

        `Grab.move` pulls the body; `Grab.release` ends the grab. The spring holds a patch of about a quarter
        of the body's size. If the force exceeds the strength of the patch, the force acts on the whole body,
        so that strong pulls do not distort the patch.
        Args:
            triangle: triangle of `surface`.
            barycentrics: barycentric coordinates of the point on the triangle, (3,).
            frequency: frequency of the spring with the mass of the whole body [Hz].
            max_force: largest force [N]; None is ten times the body's weight on Earth.
        Raises: OptionError for invalid numbers; MeshError for a body without surface; StateError before
            `build`, with schedule "flat", and if the world's 16 grabs are all in use.
        """
        return grab_at(self, triangle, barycentrics, None, frequency, max_force)

    @recorded
    def set_material(self, material: AnyMaterial) -> None:
        """Change the material to another of the same type, as if the body had been added with it.

        Positions and velocities do not change, so a different density changes the momentum. In a deformed
        body, a stiffer material has more strain energy, which would throw the body. So stiffness rises
        gradually over 0.5 s, or over 1.3 periods of the slowest vibration if that is longer, and vibrations
        are damped meanwhile. The property `material` changes at once. `World.stable_substeps` and steps
        without `substeps` estimate the new stable step at once (about 0.2 s for 5,000 tetrahedra); steps with
        `substeps` cause no estimate and no warning.
        Args:
            material: material of the same type, valid for the body's law and mesh.
        Raises: MaterialError for another type or invalid constants; StateError before `build`.
        Example:
            body.set_material(Material(young=2e5, poisson=0.4, density=1000))  # four times as stiff
        """
        set_material(self, material)

    @recorded
    def set_damping(self, damping: float | NDArray[np.float64]) -> None:
        """Change the material's damping b.

        Args:
            damping: damping b, one number or one per element [N s/m], 0 or more.
        Raises: as `set_material`.
        """
        set_damping(self, damping)
