"""What a game does to one body."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.bodies.status import SHELTERED
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
    """What of a body changes it."""

    @recorded
    def apply_force(self, force: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Push throughout the coming step, all particles named with the same acceleration. Calls add up.

        Args:
            force: total, (3,) [N]. What falls to pinned particles goes to what holds them.
            particles: that it acts on; None means all.
        Raises: OptionError for bad numbers or vertices; StateError before `build` and under schedule "flat".
        """
        apply_force(self, force, particles)

    @recorded
    def set_gravity_scale(self, scale: float) -> None:
        """Multiply the world's gravity for this body, from now on: 0 floats, -1 rises.

        Args:
            scale: factor of the world's gravity; 1 at first.
        """
        set_gravity_scale(self, scale)

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the friction of its `Contact`, which counts between bodies, from the next step on.

        What it finds on a floor or another collider is theirs: `World.set_friction`, `Collider.set_friction`.
        Args:
            friction: Coulomb's coefficient, 0 or more.
        Raises: OptionError for a number out of range; StateError before `build`, and in a world without
            `soft_contact`, where bodies do not touch each other.
        """
        set_friction(self, friction)

    @property
    def linear_damping(self) -> float:
        """Rate at which its velocities fade [1/s], 0 unless it was set."""
        simulation = self._context.fields
        return 0.0 if simulation is None else float(simulation.state.body_damping[self.index])

    @property
    def is_sheltered(self) -> bool:
        """Whether no wind blows on it."""
        simulation = self._context.fields
        drives = 0 if simulation is None else int(simulation.state.body_drives[self.index])
        return bool(drives & SHELTERED)

    @recorded
    def set_linear_damping(self, rate: float) -> None:
        """Let all velocities fade by exp(-rate t), from now on, against the world at rest [1/s].

        Args:
            rate: [1/s], 0 or more; 0 at first.
        Raises: OptionError for a negative rate; StateError before `build` and under schedule "flat".
        """
        set_linear_damping(self, rate)

    @recorded
    def set_sheltered(self, is_sheltered: bool) -> None:
        """True keeps the wind of `World.set_wind` off this body, from now on.

        Args:
            is_sheltered: False at first.
        """
        set_sheltered(self, is_sheltered)

    @recorded
    def apply_impulse(self, impulse: ArrayLike, particles: ArrayLike | None = None) -> None:
        """Change the momentum at once; all particles named change their velocity by the same.

        Args:
            impulse: total, (3,) [N s]. What falls to pinned particles goes to what holds them.
            particles: that it acts on; None means all.
        Raises: OptionError for bad numbers or vertices; StateError before `build`. So do all that follow.
        Example:
            body.apply_impulse((0, 0, 2.0 * body.masses.sum()))  # 2 m/s upwards
        """
        apply_impulse(self, impulse, particles)

    @recorded
    def apply_impulse_at_point(self, impulse: ArrayLike, point: ArrayLike, radius: float) -> None:
        """Change the momentum of the particles near a point, those at the distance r by (1 - (r/radius)^2)^2
        as much in velocity as one at the point.

        Args:
            impulse: total, (3,) [N s], however few particles share it.
            point: (3,) [m].
            radius: of what is moved [m].
        Raises: OptionError with the nearest distance where no particle is within reach.
        """
        apply_impulse_at_point(self, impulse, point, radius)

    @recorded
    def set_velocity(self, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Set the velocities of all particles that are not pinned to those of a rigid body.

        Args:
            linear: velocity of the centre of mass, (3,) [m/s].
            angular: turn about the centre of mass, (3,) [rad/s].
        """
        set_velocity(self, linear, angular)

    @recorded
    def teleport(
        self, position: ArrayLike, rotation: ArrayLike | None = None, *, keep_velocity: bool = True
    ) -> None:
        """Move the whole body, deformed as it is, by a jump; pictures between two steps jump with it, and so
        do targets that were set for the coming step.

        Args:
            position: where its centre of mass goes, (3,) [m].
            rotation: turn about the centre of mass, from how it lies now: matrix or quaternion (x, y, z, w).
            keep_velocity: True turns velocities with the body, False stops it.
        Raises: OptionError where it would lie below the floor, or crushed in a collider.
        """
        teleport(self, position, rotation, keep_velocity)

    @recorded
    def pin(self, particles: ArrayLike) -> None:
        """Hold particles where they are, from now on.

        Args:
            particles: vertices of this body.
        Example:
            left = np.flatnonzero(body.mesh.vertices[:, 0] < -0.24)
            body.pin(left)
            world.step(1 / 60)
            body.unpin(left)
        """
        pin(self, particles)

    @recorded
    def unpin(self, particles: ArrayLike | None = None) -> None:
        """Let pinned particles go, all if None, with the velocity that they were moved with last.

        Args:
            particles: vertices of this body; None, the default, means all.
        """
        unpin(self, particles)

    @recorded
    def set_targets(self, particles: ArrayLike, positions: ArrayLike) -> None:
        """Move pinned particles by hand: in the coming step they go straight to `positions`, (n, 3) [m].

        After it they stand still, unless they are given new targets.
        Args:
            particles: pinned vertices, (n,).
            positions: where they go, (n, 3) [m].
        Raises: OptionError for shapes that do not fit; StateError for a particle that is not pinned.
        """
        set_targets(self, particles, positions)

    @recorded
    def attach(self, particles: ArrayLike, frame: Frame, *, two_way: bool = False) -> Attachment:
        """Let particles go with a frame from now on, at the places that they have relative to it.

        Args:
            particles: vertices; pinned ones may be among them.
            frame: of the same world.
            two_way: add up what they pull the frame with: `Attachment.force` and `Attachment.torque`.
        Raises: OptionError for what is no frame of this world; StateError for a particle that is attached
            already, and for `two_way` under schedule "flat".
        """
        return attach(self, particles, frame, two_way)

    @recorded
    def attach_to(self, other: SoftBody, particles: ArrayLike, *, onto: ArrayLike | None = None) -> Joint:
        """Let another body hold particles of this one from now on, until `Joint.release`.

        The two then move as one there, whatever their masses and stiffness: what a particle does to its place
        the place does to it, so momentum and angular momentum stay. Where they come apart all the same, as by
        `teleport`, they are drawn together no faster than they can follow. The particles and what holds them
        do not touch each other; the rest of the two bodies does, where `soft_contact` lets them. Joined
        bodies sleep and wake together; `World.despawn` of either ends the joint, a frozen one holds the other
        where it is.
        Args:
            other: of the same world, with tetrahedra unless `onto` is given.
            particles: vertices of this body; best those of the finer mesh.
            onto: vertices of `other`, one for each of `particles`, that these are drawn to. None holds each
                at the place in `other` where it is, in a tetrahedron or just outside of one.
        Raises: OptionError for what is no other body, for bad vertices, and without `onto` for those that are
            too far away; StateError before `build`, in a world without contact, under implicit Euler, and
            where the world's 64 joints, or the 2,048 particles that they may hold, are all in use.
        Example:
            rider = world.spawn(ball, position=(0, 0, 0.8))
            lowest = rider.positions()[:, 2].argsort()[:4]
            joint = rider.attach_to(body, lowest)
            world.step(1 / 60)
            joint.release()
        """
        return self._context.of(Joints).join(self, other, particles, onto)

    @recorded
    def grab(
        self,
        triangle: int,
        barycentrics: ArrayLike = (1 / 3, 1 / 3, 1 / 3),
        *,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab:
        """Take hold of the surface: `move` pulls the body by a spring without swing, `release` lets go.

        The spring holds a patch of about a quarter of the body's size. What is more than the patch can bear
        pulls at the whole body, so that nothing is torn, whatever is asked for.
        Args:
            triangle: of `surface`.
            barycentrics: where on it, (3,).
            frequency: of the spring with the whole body on it [Hz].
            max_force: strongest pull [N]; None is ten times the body's weight on Earth.
        Raises: OptionError for bad numbers; MeshError for a body without surface; StateError before `build`,
            under schedule "flat", and where the world's 16 grabs are all in use.
        """
        return grab_at(self, triangle, barycentrics, None, frequency, max_force)

    @recorded
    def set_material(self, material: AnyMaterial) -> None:
        """Make the body of another material of the same kind, from now on, as if it had been added with it.

        Positions and velocities stay, so another density changes its momentum. A stiffer law would find more
        strain energy in a deformed body and throw it. So if the body becomes stiffer by that, the change is
        eased in over half a second, or 1.3 periods of its slowest vibration where that is longer, and
        vibrations fade meanwhile; `material` is the new one at once. `World.stable_substeps` and
        steps without given substeps reflect it at once, at the price of a new estimate (some 0.2 s for 5,000
        tetrahedra); with substeps given nothing is estimated, and nothing warns of too few.
        Args:
            material: of the type that the body has, fit for its law and mesh.
        Raises: MaterialError for another type, or constants that do not fit; StateError before `build`.
        Example:
            body.set_material(Material(young=2e5, poisson=0.4, density=1000))  # four times as stiff
        """
        set_material(self, material)

    @recorded
    def set_damping(self, damping: float | NDArray[np.float64]) -> None:
        """Change the material's damping b [N s/m], from now on, one number or one per element.

        Args:
            damping: [N s/m], 0 or more: one number, or one for each element.
        Raises: as `set_material`.
        """
        set_damping(self, damping)
