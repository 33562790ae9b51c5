"""Methods of a world for colliders, frames, grabs, motors, gravity and wind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, cast

from numpy.typing import ArrayLike

from taichi_soft.bodies.soft_body import Slice
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import Colliders
from taichi_soft.contact.shapes import Shape
from taichi_soft.control.attachments import Attachments
from taichi_soft.control.change import require_per_body
from taichi_soft.control.drives import set_gravity, set_wind
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.frictions import set_floor_friction
from taichi_soft.control.grabs import Grab, Grabs, as_pull
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.control.joints import Joint, Joints
from taichi_soft.control.motors import Motor, Motors
from taichi_soft.core.checks import as_vector
from taichi_soft.core.constants import ALL_GROUPS
from taichi_soft.core.handles import recorded
from taichi_soft.core.types import JointKindName
from taichi_soft.fracture.tearing import Tears
from taichi_soft.queries import ChosenColliders, cast_ray, targets_of
from taichi_soft.solver.origin import shift_origin
from taichi_soft.world.body import Body
from taichi_soft.world.spawning import require_own
from taichi_soft.world.world_parts import WorldParts

SLICES: tuple[type[Slice], ...] = (Colliders, Frames, Attachments, Grabs, Joints, Motors, Tears, Easings)
"""Classes of all slices, in the order in which a snapshot restores them. Each slice comes after the slices on
which it depends."""


class WorldControl(WorldParts):
    """Methods of a world that add objects or act on all bodies."""

    @property
    def colliders(self) -> Sequence[Collider]:
        """All colliders, including the floor after `build`."""
        return self._context.colliders.handles

    @property
    def frames(self) -> Sequence[Frame]:
        """All frames."""
        return self._context.of(Frames).handles

    @property
    def grabs(self) -> Sequence[Grab]:
        """All active grabs, including those that `restore` created."""
        return self._context.of(Grabs).handles

    @recorded
    def connect(
        self,
        body: Body,
        other: Body,
        kind: JointKindName = "ball",
        *,
        anchor: ArrayLike,
        axis: ArrayLike = (0.0, 0.0, 1.0),
        break_force: float | None = None,
    ) -> Joint:
        """Connect a rigid body to another body, where the two are now.

        Args:
            body: rigid body.
            other: rigid or soft body. For "slider", a rigid body.
            kind: "ball" turns about a point, "hinge" about an axis, "slider" moves along an axis, "fixed"
                does not move. Only a part of a soft body as large as half of `body` holds it.
            anchor: point about which the body turns, (3,) [m].
            axis: axis of "hinge" and "slider", (3,), of any length.
            break_force: force at which the joint breaks [N], as for `Body.attach_to`; None: never.
        Returns: a handle of the joint, as from `Body.attach_to`. The two bodies do not touch while it holds.
        Raises: OptionError for invalid arguments, and for an anchor that is too far from a soft body;
            StateError before `build`, or if too many joints are in use.
        Example:
            arena = World(floor=0.0)
            pillar = arena.add_rigid(box((0.3, 0.3, 2.0)), mass=200.0, position=(-0.2, 0, 1.0))
            door = arena.add_rigid(box((0.9, 0.05, 1.9)), mass=20.0, position=(0.45, 0, 1.0))
            arena.build()
            arena.connect(door, pillar, "hinge", anchor=(0, 0, 1.0), axis=(0, 0, 1))
        """
        require_own(self._context, body)
        return self._context.of(Joints).connect(body, other, kind, anchor, axis, break_force)

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints between bodies (`Body.attach_to`), including those that `restore` created."""
        return self._context.of(Joints).handles

    @property
    def motors(self) -> Sequence[Motor]:
        """All motors, including those that `restore` created."""
        return self._context.of(Motors).handles

    @property
    def floor_collider(self) -> Collider | None:
        """Collider of the floor, for example to read impulses on the floor.

        None before `build`, and in worlds without a floor or without colliders.
        """
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
        surface_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Collider:
        """Add a collider. The vertices of bodies collide with its surface.

        A shape smaller than the triangles of a body can slip between the body's vertices. After `build`, at
        least `World(collider_room=15)` more colliders can be added, with `sample_room` samples for height
        fields and meshes.
        Args:
            shape: `PlaneShape`, `SphereShape`, `BoxShape`, `CapsuleShape`, `HeightFieldShape` or `MeshShape`.
            position: position of the collider's origin, (3,) [m].
            rotation: rotation of the collider, matrix (3, 3) or quaternion (x, y, z, w).
            friction: Coulomb coefficient, 0 or more.
            restitution: speed of a body's centre of mass after an impact, divided by its speed before the
                impact, 0 to 1. It applies to impacts faster than 0.5 m/s. The elasticity of the body limits
                the restitution; with None, only the elasticity acts.
            thickness: distance outside the shape at which contact begins [m].
            group, mask: groups as bits. A body and a collider collide if the mask of each contains a bit of
                the other's group.
            surface_velocity: velocity of the surface relative to the collider, in the collider's frame, (3,)
                [m/s], as of a conveyor belt: see `Collider.set_surface_velocity`.
        Returns: a handle to move the collider and to read the impulse on the collider.
        Raises: OptionError for invalid values; StateError if the capacity for colliders is used up.
        Example:
            lift = world.add_collider(BoxShape((1, 1, 0.1)), position=(3, 0, 0.2))
            lift.move_to((3, 0, 0.25))  # its position after the next step
            world.step(1 / 60)
            print(lift.impulse)  # from the bodies on the lift [N s]
        """
        return self._add_collider(
            shape,
            position=position,
            rotation=rotation,
            friction=friction,
            restitution=restitution,
            thickness=thickness,
            group=group,
            mask=mask,
            surface_velocity=surface_velocity,
        )

    @recorded
    def add_sensor(
        self,
        shape: Shape,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        group: int = 1,
        mask: int = ALL_GROUPS,
    ) -> Collider:
        """Add a sensor: a collider that bodies do not touch, and that reports which bodies are in it.

        `Collider.bodies_inside` returns the bodies that touch or enclose the sensor. With `on` or
        `record_events`, the world sends `Entered` and `Left`. Both are tested after each step, so a body can
        pass a sensor unseen if it moves farther in a step than the sensor is thick. A sensor wakes no body.
        It moves, teleports and is removed as a collider, and takes the room of one.
        Args:
            shape: any shape of a collider.
            position: position of the sensor's origin, (3,) [m].
            rotation: rotation of the sensor, matrix (3, 3) or quaternion (x, y, z, w).
            group, mask: groups as bits. A sensor reports a body if the mask of each contains a bit of the
                other's group.
        Returns: a handle, for which `Collider.is_sensor` is True.
        Raises: as `add_collider`.
        Example:
            goal = world.add_sensor(BoxShape((1, 3, 2)), position=(5, 0, 1))
            world.on(Entered, lambda event: print(event.body, "is in", event.sensor))
            world.step(1 / 60)
            world.drain_events()
            print(goal.bodies_inside)
        """
        return self._add_collider(
            shape, position=position, rotation=rotation, group=group, mask=mask, is_sensor=True
        )

    def _add_collider(self, shape: Shape, **options: Any) -> Collider:
        if self._context.fields is not None:
            require_per_body(self._context, "colliders beside the floor")
        collider = self._context.colliders.add(shape, **options)
        self._handles.enlist(collider)
        return collider

    @recorded
    def add_frame(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> Frame:
        """Add a frame: a pose that the game moves, and to which bodies can be attached.

        Frames can be added at any time.
        Args:
            position: position of the frame's origin, (3,) [m].
            rotation: rotation of the frame, matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError for invalid numbers.
        Example:
            hand = world.add_frame(position=(0, 0, 0.5))
            hold = body.attach(np.flatnonzero(body.positions()[:, 2] > 0.45), hand, two_way=True)
            hand.move_to((0, 0, 0.52))  # its position after the next step
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
        colliders: ChosenColliders = False,
        mask: int = ALL_GROUPS,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab | None:
        """Grab the first body that a ray hits, with `raycast` and `Body.grab`.

        Args:
            origin, direction, max_distance, bodies, mask: see `raycast`.
            colliders: colliders that stop the ray; True for all, False for none.
            frequency: frequency of the critically damped spring [Hz].
            max_force: largest force [N]; None is ten times the body's weight on Earth.
        Returns: a handle to move and release the grab, or None if the ray hits no body first.
        Raises: OptionError for numbers out of range, or a body or collider of another world; StateError
            before `build`, with schedule "flat", or if all grabs are in use.
        Example:
            hand = world.grab(origin=(0, 0, 5), direction=(0, 0, -1))  # from the camera through the mouse
            if hand is not None:
                hand.move((0, 0, 1))
                world.step(1 / 60)
                hand.release()
        """
        as_pull(frequency, max_force)  # checks the arguments even if the ray hits nothing
        targets = targets_of(self._context, bodies, colliders, mask)
        hit = cast_ray(targets, origin, direction, max_distance, True)
        if hit is None or hit.body is None:
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
        """Add a motor, which rotates a part of a body about an axis or pushes the part along the axis.

        The motor accelerates the particles as a rigid part, up to a target speed; the rest of the body
        follows by its elasticity. The torque or force is external, as from a shaft in the level. No other
        body receives a reaction. The motor does not keep the body on the axis. With implicit Euler, elastic
        forces act after the motor, so heavily loaded particles stay below the target speed; more substeps
        reduce the difference.
        Args:
            body: body of this world.
            particles: vertices to drive. Pinned vertices stay fixed.
            axis: direction (3,) of the axis in the body's current pose, of any nonzero length.
            speed: target speed, right-handed about the axis [rad/s] or along the axis [m/s]. 0 brakes the
                particles.
            max_torque: largest torque about the axis [N m]. Give this to rotate the particles.
            max_force: largest force along the axis [N]. Give this to push the particles.
            is_fixed: False rotates the axis with the particles, as for a wheel or a rocket. True fixes the
                direction of the axis in space, as for a mill or for steering.
            point: point of a fixed axis, (3,) [m], with `is_fixed` and `max_torque`. By default the axis
                passes through the centre of mass of the particles.
        Returns: a handle to change the speed and the limit, to read the effort, and to remove the motor.
        Raises: OptionError for invalid numbers or vertices, a body of another world, both limits or no limit,
            and without `is_fixed` for particles on a line; StateError before `build`, with schedule "flat",
            and if the world's 64 motors, or their 16,384 particles, are all in use.
        """
        require_own(self._context, body)
        motors = self._context.of(Motors)
        return motors.add(body, particles, axis, speed, max_torque, max_force, is_fixed, point)

    @recorded
    def apply_radial_impulse(self, center: ArrayLike, impulse: float, radius: float) -> None:
        """Push all bodies away from a point, as an explosion does.

        A particle of mass m at the distance r receives `impulse` times m/M (1 - (r/radius)^2)^2, where M is
        the mass of its body. So a light body is thrown farther than a heavy body, and the impulse acts only
        on the part of a body within the radius.
        Args:
            center: centre of the explosion, (3,) [m].
            impulse: impulse on a small body near the centre [N s]; a negative impulse pulls.
            radius: range of the impulse [m].
        Raises: OptionError for a number out of range; StateError before `build`.
        """
        apply_radial_impulse(self._context, center, impulse, radius)

    @recorded
    def set_gravity(self, gravity: ArrayLike) -> None:
        """Change gravity from the next step on, and wake all bodies. This call also works before `build`.

        With leapfrog, velocities lag by half a substep, and the new gravity also applies to that half. Bodies
        that are too soft for their new weight cause no warning.
        Args:
            gravity: acceleration of gravity, (3,) [m/s^2].
        Raises: OptionError for numbers out of range.
        """
        set_gravity(self._context, gravity)

    @recorded
    def set_friction(self, friction: float) -> None:
        """Change the floor's Coulomb coefficient from the next step on, and wake all bodies.

        This call also works before `build`. For other colliders, see `Collider.set_friction`; for contact
        between bodies, see `Body.set_friction`.
        Args:
            friction: Coulomb coefficient, 0 or more.
        Raises: OptionError for a number out of range; StateError in a world without a floor.
        """
        floor = self._context.floor_collider
        if floor is None:
            set_floor_friction(self._context, friction)
        else:
            floor.set_friction(friction)

    @recorded
    def shift_origin(self, offset: ArrayLike) -> None:
        """Move the origin of the world's coordinates, for a game that moves its own.

        All coordinates decrease by `offset`: bodies, their positions before the last step, bounds of sleeping
        bodies, targets of pins, colliders, the floor, frames, attachments, grabs, joints and motors. Nothing
        moves relative to anything else, and sleeping bodies stay asleep. The shift is exact if all
        coordinates have fewer digits afterwards, as near an offset that is a multiple of a large power of
        two; otherwise float32 rounds them. Snapshots from before the shift restore the old coordinates. Move
        your own places too: the camera, a force field, positions that you have stored.
        Args:
            offset: the new origin in the old coordinates, (3,) [m].
        Raises: OptionError for numbers that are not finite, or an offset that puts a body or collider out of
            range; StateError before `build`.
        Example:
            world.shift_origin((1024, 0, 0))  # what was at x = 1024 m is now at x = 0
        """
        shift_origin(self._context, offset)

    def set_view_origin(self, point: ArrayLike) -> None:
        """Draw relative to a point, such as the camera, so that pictures far from the origin do not tremble.

        `read_positions` and `read_render_mesh` then return positions minus `point`, computed before they are
        rounded to float32. All other coordinates stay those of the world. The simulation does not change, and
        snapshots do not contain the point.
        Args:
            point: point in the world, (3,) [m].
        Raises: OptionError for numbers that are not finite or out of range; StateError before `build`.
        """
        self._context.built.readout.set_view_origin(as_vector(point, "point", "m"))

    @recorded
    def set_wind(self, velocity: ArrayLike | None, *, density: float = 1.2, drag: float = 1.0) -> None:
        """Set the wind, which acts on the surfaces of all bodies.

        A triangle of area A, with the relative air speed v_n along its normal n, receives the force 1/4
        density drag A |v_n| v_n n. This force is half the drag of a plate, because a closed body, or a sheet
        with triangles on both sides, has one triangle that faces the wind and one triangle that faces away.
        So the drag coefficient of a box is `drag`, and the drag coefficient of a sphere is half of `drag`.
        The wind never accelerates a vertex beyond the wind's speed.
        Args:
            velocity: velocity of the air, (3,) [m/s]; zero means still air, which brakes bodies; None means
                no air.
            density: density of the air [kg/m^3].
            drag: drag coefficient of a plate perpendicular to the wind.
        Raises: OptionError for a number out of range; StateError before `build` and with schedule "flat".
        """
        set_wind(self._context, velocity, density, drag)
