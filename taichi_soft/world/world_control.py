"""What a game adds to a world and does to all of it: colliders, frames, grabs, motors, wind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import cast

from numpy.typing import ArrayLike

from taichi_soft.bodies.soft_body import Slice
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import Colliders
from taichi_soft.contact.shapes import Shape
from taichi_soft.control.attachments import Attachments
from taichi_soft.control.drives import set_gravity, set_wind
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.frictions import set_floor_friction
from taichi_soft.control.grabs import Grab, Grabs, as_pull
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.control.joints import Joint, Joints
from taichi_soft.control.motors import Motor, Motors
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.errors import StateError
from taichi_soft.core.handles import recorded
from taichi_soft.fracture.tearing import Tears
from taichi_soft.queries import cast_ray
from taichi_soft.world.body import Body
from taichi_soft.world.spawning import require_own
from taichi_soft.world.world_parts import WorldParts

SLICES: tuple[type[Slice], ...] = (Colliders, Frames, Attachments, Grabs, Joints, Motors, Tears, Easings)
"""What a game switches on, in the order in which a snapshot puts it back: what hangs comes after what it
hangs from."""


class WorldControl(WorldParts):
    """What of a world is done to bodies, and what stands in their way."""

    @property
    def colliders(self) -> Sequence[Collider]:
        """All colliders; from `build` on the floor is among them."""
        return self._context.colliders.handles

    @property
    def frames(self) -> Sequence[Frame]:
        """All frames that bodies are, or can be, attached to."""
        return self._context.of(Frames).handles

    @property
    def grabs(self) -> Sequence[Grab]:
        """All grabs that hold a body, also those that `restore` brought along."""
        return self._context.of(Grabs).handles

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints between bodies (`Body.attach_to`), also those that `restore` brought along."""
        return self._context.of(Joints).handles

    @property
    def motors(self) -> Sequence[Motor]:
        """All motors that drive bodies, also those that `restore` brought along."""
        return self._context.of(Motors).handles

    @property
    def floor_collider(self) -> Collider | None:
        """The floor where there are colliders, from `build` on: to read what bodies do to it."""
        return self._context.floor_collider

    @recorded
    def add_collider(
        self,
        shape: Shape,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        friction: float = 0.5,
        restitution: float | None = None,
        thickness: float = 0.0,
        group: int = 1,
        mask: int = ALL_GROUPS,
    ) -> Collider:
        """Add something solid that bodies hit: after `build` where `collider_room` was left for it, and
        `sample_room` for a height field or mesh.

        Vertices of bodies touch it; what is smaller than a body's triangles may slip between them.
        Args:
            shape: `PlaneShape`, `SphereShape`, `BoxShape`, `CapsuleShape`, `HeightFieldShape` or `MeshShape`.
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
            friction: Coulomb coefficient, 0 or more.
            restitution: 0 to 1: speed with which a body's centre of mass leaves it, over that with which it
                came near, for what comes faster than half a metre per second; no more than the body's own
                elasticity gives. None leaves bodies that elasticity.
            thickness: of a skin on it [m].
            group, mask: bits. A body and a collider touch where each one's mask has a bit of the other's
                group.
        Returns: a handle, to move it and to read the impulse on it.
        Raises: OptionError for bad values; StateError where there is no room left.
        Example:
            lift = world.add_collider(BoxShape((1, 1, 0.1)), position=(3, 0, 0.2))
            lift.move_to((3, 0, 0.25))  # where it is after the next step
            world.step(1 / 60)
            print(lift.impulse)  # from the bodies on it [N s]
        """
        if self._context.fields is not None and self._context.fields.colliders is None:
            raise StateError(
                "schedule 'flat' has no colliders but the floor: make the world with schedule='per_body'"
            )
        collider = self._context.colliders.add(
            shape,
            position=position,
            rotation=rotation,
            friction=friction,
            restitution=restitution,
            thickness=thickness,
            group=group,
            mask=mask,
        )
        self._handles.enlist(collider)
        return collider

    @recorded
    def add_frame(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> Frame:
        """A place that the engine moves, to attach bodies to; at any time.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError for bad numbers.
        Example:
            hand = world.add_frame(position=(0, 0, 0.5))
            hold = body.attach(np.flatnonzero(body.positions()[:, 2] > 0.45), hand, two_way=True)
            hand.move_to((0, 0, 0.52))  # where it is after the next step
            world.step(1 / 60)
            print(hold.force)  # on the hand [N]
        """
        frame = Frame(self._context.of(Frames), position, rotation)
        self._handles.enlist(frame)
        return frame

    def grab(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        *,
        max_distance: float = math.inf,
        bodies: Iterable[Body] | None = None,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab | None:
        """Take hold of the first body that a ray hits: as `raycast`, and `Body.grab` there.

        Colliders do not stop the ray: `max_distance` does, where your level is in the way.

        Args:
            origin, direction, max_distance, bodies: of the ray.
            frequency: of the spring, critically damped [Hz].
            max_force: strongest pull [N]; None for ten times the weight of the body on Earth.
        Returns: a handle to move and release it with, or None where the ray hits nothing.
        Raises: OptionError for numbers out of range or a body of another world; StateError before `build`,
            under schedule "flat", or where all grabs are in use.
        Example:
            hand = world.grab(origin=(0, 0, 5), direction=(0, 0, -1))  # from the camera through the mouse
            if hand is not None:
                hand.move((0, 0, 1))
                world.step(1 / 60)
                hand.release()
        """
        as_pull(frequency, max_force)  # also where the ray hits nothing
        state, slots = self._built.state, self._context.slots.slots
        hit = cast_ray(state, slots, origin, direction, max_distance, bodies, True)
        if hit is None:
            return None
        body = cast(Body, hit.body)
        return body.grab(hit.triangle, hit.barycentrics, frequency=frequency, max_force=max_force)

    @recorded
    def add_motor(
        self,
        body: Body,
        particles: ArrayLike,
        axis: ArrayLike,
        *,
        speed: float,
        max_torque: float | None = None,
        max_force: float | None = None,
        is_fixed: bool = False,
        point: ArrayLike | None = None,
    ) -> Motor:
        """Turn a part of a body about an axis, or push it along one, towards a speed, until `Motor.remove`.

        The particles are moved as one rigid thing; the rest of the body follows by its elasticity. What the
        motor gives comes from outside, as from a shaft in the level: no other body feels the reaction. It
        does not hold the body on the axis. By implicit Euler the elastic forces of a substep act after the
        motor, so the particles stay behind the speed where much hangs on them; more substeps help.
        Args:
            body: of this world.
            particles: vertices of it that are driven; pinned ones stay where they are.
            axis: direction (3,), of any length but zero, as the body lies now.
            speed: to reach and to hold [rad/s], right-handed about the axis; or along it [m/s]. 0 brakes.
            max_torque: give this to turn: largest torque about the axis [N m].
            max_force: give this to push: largest force along the axis [N].
            is_fixed: False lets the axis turn with the particles, as in a wheel or a rocket. True keeps its
                direction in space, as of a mill, or of what steers.
            point: on an axis that stays in space, (3,) [m], with `is_fixed` and `max_torque`. None lets the
                axis pass through the centre of mass of the particles, wherever that goes.
        Returns: a handle to change the speed and the limit with, to read the effort, and to remove it.
        Raises: OptionError for bad numbers, vertices or a body of another world, for both limits or none, and
            without `is_fixed` for particles on a line; StateError before `build`, in a world without a
            collider, `collider_room` and `soft_contact`, and where the world's 64 motors, or the 16,384
            particles that they may drive, are all in use.
        """
        require_own(self._context, body)
        motors = self._context.of(Motors)
        return motors.add(body, particles, axis, speed, max_torque, max_force, is_fixed, point)

    @recorded
    def apply_radial_impulse(self, center: ArrayLike, impulse: float, radius: float) -> None:
        """Push all bodies away from a point: an explosion.

        A particle of mass m at the distance r takes up impulse m/M (1 - (r/radius)^2)^2, M being the mass of
        its body: a light body is thrown farther than a heavy one, and one that lies half out of reach is
        pushed on its near half only.
        Args:
            center: (3,) [m].
            impulse: on a small body near the centre [N s]; negative pulls it there.
            radius: where nothing is felt any more [m].
        Raises: OptionError for a number out of range; StateError before `build`.
        """
        apply_radial_impulse(self._context, center, impulse, radius)

    @recorded
    def set_gravity(self, gravity: ArrayLike) -> None:
        """Change gravity, from the next step on; who sleeps wakes. Before `build` the world is built with it.

        Velocities of leapfrog are half a substep old, and take up the new gravity for that half too. Nothing
        warns of bodies that are too soft for their weight then.
        Args:
            gravity: (3,) [m/s^2].
        Raises: OptionError for numbers out of range.
        """
        set_gravity(self._context, gravity)

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the floor's Coulomb coefficient, from the next step on; who sleeps wakes. Before `build` the
        world is built with it.

        Other colliders keep theirs, and so do bodies among each other: `Collider.set_friction`,
        `Body.set_friction`.
        Args:
            friction: 0 or more.
        Raises: OptionError for a number out of range; StateError in a world without a floor.
        """
        floor = self._context.floor_collider
        if floor is None:
            set_floor_friction(self._context, friction)
        else:
            floor.set_friction(friction)

    @recorded
    def set_wind(self, velocity: ArrayLike | None, *, density: float = 1.2, drag: float = 1.0) -> None:
        """Let air move over the surfaces of all bodies, from now on.

        A triangle of area A, with the air at v_n past it along its normal n, takes up 1/4 density drag A
        |v_n| v_n n: half of the drag of a plate, as a closed body, or a sheet whose triangles are listed for
        each side, has one towards the wind and one away from it. So a box has the drag coefficient `drag`
        and a sphere half of it. However strong, it takes no vertex beyond its own speed.
        Args:
            velocity: of the air, (3,) [m/s]; zero is still air, which brakes; None is no air.
            density: of the air [kg/m^3].
            drag: coefficient of a plate across the wind.
        Raises: OptionError for a number out of range; StateError before `build` and under schedule "flat".
        """
        set_wind(self._context, velocity, density, drag)
