"""The world: add bodies, build, step, read."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar, cast

from numpy.typing import ArrayLike

from taichi_soft.bodies.asset import Floats32, SoftBodyAsset
from taichi_soft.bodies.contact import DEFAULT_CONTACT, Contact
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.plasticity import Plasticity
from taichi_soft.bodies.slots import Pools
from taichi_soft.bodies.soft_body import Slice, SoftBody
from taichi_soft.bodies.stability import StableStep
from taichi_soft.bodies.tearing import Tearing
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import MOST_SAMPLES, Colliders
from taichi_soft.contact.shapes import Shape
from taichi_soft.control.access import require_substeps
from taichi_soft.control.attachments import Attachments
from taichi_soft.control.drives import ForceField, push_by_field, require_field, set_wind
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.grabs import Grab, Grabs, as_pull
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.control.joints import Joint, Joints
from taichi_soft.control.motors import Motor, Motors
from taichi_soft.core.checks import as_count, as_flag, as_number, as_path, as_vector
from taichi_soft.core.clock import Clock
from taichi_soft.core.constants import ALL_GROUPS, GRAVITY_EARTH, VELOCITY_LIMIT
from taichi_soft.core.errors import FrozenBodyWarning, OptionError, StateError
from taichi_soft.core.handles import Handle, Handles, recorded, serial_of
from taichi_soft.core.settings import ContactSettings, Settings
from taichi_soft.core.signals import Whole
from taichi_soft.core.types import DampingModel, Flips, Integrator, Schedule, Strain
from taichi_soft.elements.materials import AnyMaterial
from taichi_soft.events import Event, Listener
from taichi_soft.fracture.tearing import Tears
from taichi_soft.meshing import BodyMesh
from taichi_soft.persistence.recorder import Recorder
from taichi_soft.persistence.snapshot import restore_snapshot, state_hash, take_snapshot
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
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.simulation import Simulation
from taichi_soft.solver.substeps import Substeps
from taichi_soft.world.body import Body
from taichi_soft.world.building import build
from taichi_soft.world.spawning import add_body, despawn, require_open, require_own, reserve, spawn, take_in
from taichi_soft.world.warm_up import warm_up

MOST_RETRIES = 10
"""A thousand times as many substeps as were asked for."""

SLICES: tuple[type[Slice], ...] = (Colliders, Frames, Attachments, Grabs, Joints, Motors, Tears)
"""What a game switches on, in the order in which a snapshot puts it back: what hangs comes after what it
hangs from."""

Happened = TypeVar("Happened", bound=Event)


class World(Handle):
    """Soft bodies under gravity, above a floor. SI units, z is up.

    Any thread may call it and its handles, one at a time: a second one gets a StateError that names both, and
    nothing is changed. So does a process that was forked after Taichi had started.

    Args:
        gravity: (3,) [m/s^2].
        floor: height of a horizontal floor [m], or None for none.
        restitution: of the floor, 0 to 1; None leaves bodies their own elasticity. With colliders or contact
            between bodies in the world it is as in `add_collider`. Without, the floor throws each vertex back
            by itself: bodies keep their own elasticity at 0 too, which is what None is there, and a damped
            one may well bounce lower at 1 than at 0.
        friction: Coulomb coefficient of the floor, 0 or more.
        integrator: "leapfrog", "lazy_leapfrog", "explicit_euler", or "implicit_euler": stable for every step,
            at the price of a linear solve in each and of damping that grows with its length. A step in which
            edges would change by more than half their length is made in 2 to 32 pieces.
        tolerance: of implicit solves, residual over right-hand side: 1e-6 to 0.5.
        most_iterations: of an implicit solve; one that needs more goes on as far as it came and is reported
            by a `SolverWarning`.
        schedule: "auto", "per_body" or "flat": in which loops the work runs; no effect on the physics.
        soft_contact: whether bodies touch each other.
        sleep_speed: bodies of which no particle was faster [m/s] for half a second, nor any of a body that
            they may touch, fall asleep, until something comes near or is done to them; 0 for never.
        collider_room: colliders that may be added after `build`, beside those added before.
        sample_room: samples of their grids, beside those of colliders added before: a `HeightFieldShape` or
            `MeshShape` takes `len(shape.samples)`, as long as its collider is there.
        retries: how often a step that fails for a body is made again, twice as fine each time, and then once
            more with its vibrations braked; 0 freezes the body at once, to see what a law does at a given
            step. Implicit Euler cuts its steps by itself.
        max_substeps: of one step, of 1/60 s when the world is built; a world that needs more refuses to be
            built, or to make the step. None: it only warns, above 500.
        record: steps that a flight recorder keeps, with all calls between them; 0 keeps nothing. See
            `save_recording`.
        record_to: file that it writes when a body freezes, the first time that this happens.
    Raises: OptionError for a value out of range or a name that is not known.
    """

    def __init__(
        self,
        *,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY_EARTH),
        floor: float | None = 0.0,
        restitution: float | None = None,
        friction: float = 0.5,
        integrator: str | Integrator = Integrator.LEAPFROG,
        tolerance: float = 1e-3,
        most_iterations: int = 200,
        schedule: str | Schedule = Schedule.AUTO,
        soft_contact: bool = False,
        sleep_speed: float = 0.0,
        collider_room: int = 0,
        sample_room: int = 0,
        retries: int = 3,
        max_substeps: int | None = None,
        record: int = 0,
        record_to: str | Path = "frozen.recording",
    ) -> None:
        downwards = as_vector(gravity, "gravity", "m/s^2")
        downwards.flags.writeable = False
        settings = Settings(
            gravity=downwards,
            floor=None if floor is None else as_number(floor, "floor", -1e6, 1e6, "a height [m] or None"),
            restitution=None
            if restitution is None
            else as_number(restitution, "restitution", 0.0, 1.0, "a number from 0 to 1, or None"),
            friction=as_number(friction, "friction", 0.0, 1e6, "a number from 0 to 1,000,000"),
            integrator=Integrator.parse(integrator),
            tolerance=as_number(tolerance, "tolerance", 1e-6, 0.5),
            most_iterations=as_count(most_iterations, "most_iterations"),
            retries=as_count(retries, "retries", 0, MOST_RETRIES),
            schedule=Schedule.parse(schedule),
        )
        if settings.is_implicit and settings.schedule is Schedule.FLAT:
            raise OptionError("schedule 'flat' has no implicit_euler: it takes 'per_body' or 'auto'")
        self._handles, self._serial = Handles(), 0
        self._record, self._record_to = as_count(record, "record", 0), as_path(record_to)
        touching = ContactSettings(
            collider_room=as_count(collider_room, "collider_room", 0),
            sample_room=as_count(sample_room, "sample_room", 0, MOST_SAMPLES),
            soft=as_flag(soft_contact, "soft_contact"),
            sleep_speed=as_number(
                sleep_speed, "sleep_speed", 0.0, VELOCITY_LIMIT, "a speed of 0 m/s or more"
            ),
        )
        pools: Pools[SoftBody] = Pools()
        substeps = Substeps(
            pools,
            is_implicit=settings.is_implicit,
            soft_contact=touching.soft,
            most=None if max_substeps is None else as_count(max_substeps, "max_substeps"),
        )
        self._context = WorldContext(
            settings=settings,
            clock=Clock(),
            handles=self._handles,
            slots=pools,
            layout=Scene(),
            renew_substeps=substeps.renew,
            take_in=take_in,
            contact=touching,
            substeps=substeps,
            make_body=Body,
        )
        self._context.slices += [kind(self._context) for kind in SLICES]
        self._force_field: ForceField | None = None
        self._recorder: Recorder | None = None
        self._restore_count = 0

    @property
    def settings(self) -> Settings:
        """Gravity, floor, integrator and schedule, as they were checked and chosen."""
        return self._context.settings

    @property
    def step_count(self) -> int:
        """Fixed steps made so far."""
        return self._context.clock.steps

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._context.clock.time

    @property
    def last_dt(self) -> float:
        """Length of the last fixed step [s], 0 before the first."""
        return self._context.clock.last_dt

    @property
    def bodies(self) -> Sequence[Body]:
        """All bodies that live, by the number of their slots: bodies of `add_body` in the order of adding."""
        return cast("tuple[Body, ...]", self._context.slots.living)

    @property
    def slot_count(self) -> int:
        """Slots for bodies, empty ones among them."""
        return len(self._context.slots.slots)

    @property
    def is_built(self) -> bool:
        """True from `build` on."""
        return self._context.fields is not None

    def add_body(
        self,
        mesh: BodyMesh,
        material: AnyMaterial,
        *,
        law: str | None = None,
        strain: str | Strain | None = None,
        flips: str | Flips | None = None,
        damping_model: str | DampingModel = DampingModel.EDGE,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        pinned: ArrayLike = (),
        contact: Contact = DEFAULT_CONTACT,
        plasticity: Plasticity | None = None,
        spare_vertices: int = 0,
        tearing: Tearing | None = None,
    ) -> Body:
        """Add a body before `build`: an asset of its own, one slot for it, and a body in that.

        Copies, of the same mesh and material with the same options, share the asset.
        Args:
            mesh, material, law, strain, flips, damping_model, pinned, contact, plasticity, spare_vertices,
                tearing: as `SoftBodyAsset` takes them.
            position, rotation, velocity: as `spawn` takes them.
        Returns: a handle.
        Raises: MeshError, MaterialError or OptionError for bad input; StateError after `build`.
        """
        require_open(self._context)
        asset = SoftBodyAsset(
            mesh,
            material,
            law=law,
            strain=strain,
            flips=flips,
            damping_model=damping_model,
            pinned=pinned,
            contact=contact,
            plasticity=plasticity,
            spare_vertices=spare_vertices,
            tearing=tearing,
        )
        return add_body(self._context, asset, position, rotation, velocity)

    def reserve(self, asset: SoftBodyAsset, count: int) -> None:
        """Make room for `count` more bodies of an asset, before `build`; `spawn` fills it.

        Empty slots take memory, and no time in a step.
        Raises: OptionError for what is no asset or no count, or an asset that the integrator cannot take;
            StateError after `build`.
        """
        reserve(self._context, asset, count)

    @recorded
    def spawn(
        self,
        asset: SoftBodyAsset,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Body:
        """Put a body into the lowest free slot of its asset, before `build` or between two steps.

        Args:
            asset: one that `reserve` made room for, or the `asset` of a body that was added.
            position: where the mesh's origin goes, (3,) [m].
            rotation: about the mesh's origin, matrix (3, 3) or quaternion (x, y, z, w).
            velocity: of the centre of mass, (3,) [m/s].
            angular_velocity: about the centre of mass, (3,) [rad/s]. Pinned vertices rest.
        Returns: a new handle.
        Raises: OptionError for a value out of range, or a place out of reach, below the floor or inside a
            collider; StateError for an asset without a pool in this world, or whose pool is full.
        """
        return spawn(self._context, asset, position, rotation, velocity, angular_velocity)

    @recorded
    def despawn(self, body: Body) -> None:
        """Take a body out of the world: its slot is free, and its handle dead.

        Raises: OptionError for what is no body of this world; StateError for one that was removed before.
        """
        despawn(self._context, body)

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
        """
        if self._context.fields is not None and self._context.fields.colliders is None:
            raise StateError(
                "the world was built without colliders: add one before build(), or make the world with "
                "collider_room"
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

    def build(self) -> None:
        """Move all bodies into Taichi fields and fix the kernels. Starts Taichi if nobody has.

        Warns: SlowStepWarning where 1/60 s takes more than 500 substeps, with what asks for them;
            TooSoftWarning of bodies that cannot bear their weight.
        Raises: StateError without bodies or when called twice; OptionError for a body that starts inside a
            collider, or where 1/60 s takes more substeps than `max_substeps`.
        """
        if self.is_built:
            raise StateError("the world is already built")
        self._context.fields = build(self._context)
        self._context.settings = self._context.fields.settings
        if self._record:
            self._handles.recorder = self._recorder = Recorder(self._context, self._record, self._record_to)

    @property
    def _built(self) -> Simulation:
        """Raises: StateError before `build`."""
        return self._context.built

    def stable_step(self, body: Body) -> StableStep:
        """Estimate of the largest stable substep of a body; bodies of one asset share it until they are cut.

        Raises: OptionError for what is no body.
        """
        if not isinstance(body, Body):
            raise OptionError(f"body must be one that a world made, got {body!r}")
        return self._context.substeps.stable_step(body)

    def stable_substeps(self, dt: float) -> int:
        """Number of substeps that a fixed step of `dt` [s] needs, with a margin, for the stiffest asset.

        Of all that have slots, whether a body lives there or not: so that neither the time of a frame nor the
        motion of the others changes where one comes or goes. Bodies that were cut, or given another material,
        count with an estimate of their own after each change, which takes some 35 ms for 5,000 tetrahedra and
        several times as much with `damping`: give substeps where that is too long. 1 for implicit Euler,
        which needs none; with `soft_contact` so many that they last no longer than 1/240 s.
        """
        return self._context.substeps.stable_count(dt)

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make one fixed step of `dt` [s] in `substeps` equal substeps; None chooses their number.

        A body that goes non-finite is put back to where it was before the step and frozen, with a
        `FrozenBodyWarning` and `body.failure`; the other bodies go on. Before, it and what it may touch make
        the step again with up to eight times the substeps, by `World(retries=3)`.
        Ctrl-C lets a step of less than about 0.03 s end first. It ends a longer one within a second, and the
        world is as before that step.
        Warns: FrozenBodyWarning; UnstableStepWarning for substeps longer than the stable step of the stiffest
            asset; SlowStepWarning as `build`, once in a world; SolverWarning, of implicit Euler.
        Raises: OptionError if dt is not a positive number or substeps not a positive whole one, and where
            there are more than `max_substeps`; StateError before `build`.
        """
        simulation = self._context.fields or self._built  # which raises
        seconds, count, h = self._context.substeps.choose(dt, substeps)
        if count > simulation.long_from:
            reports = self._make_long_step(simulation, seconds, count, h)
        else:
            self._push()
            with Whole():
                reports = simulation.step(seconds, count, h)
        if self._recorder is not None:
            reports += self._recorder.note_step(self._context, seconds, count, is_broken=bool(reports))
        if reports:
            warnings.warn("; ".join(reports), FrozenBodyWarning, stacklevel=3)
        if simulation.troubled:
            simulation.check_solves()

    def _push(self) -> None:
        """Let the force field act in the coming step, if there is one."""
        if self._force_field is not None:
            rows = push_by_field(self._context, self._force_field)
            if self._recorder is not None:
                self._recorder.pushes = [(serial_of(body), accelerations) for body, accelerations in rows]

    def _make_long_step(self, simulation: Simulation, seconds: float, substeps: int, h: float) -> list[str]:
        """One that Ctrl-C may end, and then all is as before."""
        before = take_snapshot(self._context)
        try:
            self._push()
            return simulation.step(seconds, substeps, h)
        except KeyboardInterrupt:
            restore_snapshot(self._context, before)
            raise

    @recorded
    def warm_up(self) -> None:
        """Compile all that a game may call, behind its loading screen, so that nothing stops it later.

        Without it each kind of call compiles where it is made first: for 0.1 to 1 s with an empty cache, for
        less in a later process. A first contact step takes 10 to 20 s, ever. A terminal is told what is being
        compiled. The world stays as it is, to the bit.
        Raises: StateError before `build`.
        """
        warm_up(self._context)

    @recorded
    def wake(self) -> None:
        """Wake all bodies that sleep."""
        if self._context.fields is not None:
            self._context.fields.wake_all()

    @recorded
    def add_frame(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> Frame:
        """A place that the engine moves, to attach bodies to; at any time.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError for bad numbers.
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
        """
        as_pull(frequency, max_force)  # also where the ray hits nothing
        hit = self.raycast(origin, direction, max_distance=max_distance, bodies=bodies)
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
            without `is_fixed` for particles on a line; StateError before `build`, under schedule "flat", and
            where the world's 64 motors, or the 16,384 particles that they may drive, are all in use.
        """
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

    def set_force_field(self, function: ForceField | None) -> None:
        """Accelerate all bodies by a function of place and time, from now on; None ends it.

        Args:
            function: (positions float32 (n, 3) [m], time [s]) -> accelerations (n, 3) [m/s^2], called once
                per step and body that is not frozen; they act throughout the step. If it raises, or returns
                something else, `step` raises and the step is not made.
        Raises: OptionError for what cannot be called; StateError under schedule "flat".
        """
        field = require_field(function)
        _ = self._built
        require_substeps(self._context, "force field")
        self._force_field = field

    def read_positions(self, body: Body, alpha: float, out: Floats32 | None = None) -> Floats32:
        """Positions of a body between the previous step (alpha 0) and the last one (alpha 1), (n, 3) [m].

        The first read after a step copies all bodies at once; further bodies at the same alpha come from
        that copy, because calling a kernel costs more than copying a thousand vertices.
        Raises: OptionError for a body of another world, an alpha out of range or an `out` that does not
            fit; StateError before `build`.
        """
        simulation = self._built
        require_own(self._context, body)
        if type(alpha) is not float or not 0.0 <= alpha <= 1.0:
            alpha = as_number(alpha, "alpha", 0.0, 1.0, "a number from 0 to 1")
        return simulation.readout.positions(body, alpha, out)

    def record_events(self, kinds: Iterable[type[Event]] = (Event,)) -> None:
        """Record events of these kinds, and no others, from the next step on, for `drain_events`.

        What touches already counts as a contact that begins in that step. `StressExceeded` and
        `TearCandidates` come of bodies with `Body.watch_stress` and `Body.watch_tearing` only.
        Args:
            kinds: classes of events; `Event` stands for all that this world has, an empty list for none.
        Raises: OptionError for what is no class of events; StateError before `build`, and for contacts in a
            world without colliders and soft contact.
        """
        self._built.events.record(kinds)

    def on(self, kind: type[Happened], function: Callable[[Happened], object]) -> Listener:
        """Let a function hear of all events of a kind, and record that kind.

        It is called by `drain_events`, never within a step, so it may do what can be done between two steps.
        Of `StressExceeded` and `TearCandidates` it hears only for bodies with a `Body.watch_stress` or
        `Body.watch_tearing`.
        Args:
            kind: a class of events; `Event` for all that this world has.
            function: takes the event.
        Returns: what `remove` ends it with.
        Raises: as `record_events`; OptionError for what cannot be called.
        """
        return self._built.events.on(kind, function)

    def drain_events(self) -> list[Event]:
        """All events since the last call, after those who listen have heard of them.

        They come step by step; within a step by kind (contacts begun and ended, stress, tear candidates,
        sleep, waking, freezing, tearing), then by the indices of bodies. Up to 10,000 wait, then the oldest
        are dropped, with a `DroppedEventsWarning` in the step.

        An exception of a listener keeps no other from hearing of any event: the first is raised at the end.
        The next call then returns these events with those that came since, and listeners hear of none twice.
        Raises: StateError before `build`, before anything is recorded, and from within a listener.
        """
        return self._built.events.drain()

    @property
    def dropped_events(self) -> int:
        """How many were dropped so far because too many waited."""
        return self._built.events.dropped

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

    def snapshot(self) -> bytes:
        """The whole state between two steps, to `restore` it here or in a world that was built alike.

        Bodies, colliders, frames, grabs, attachments and joints, the wind, materials that were set, and all
        that is going to act in the coming step are in it; a force field is not. Of the events recorded it has
        what goes on, such as contacts. It holds numbers only, no code. The first call compiles, some seconds
        at most.
        Raises: StateError before `build`.
        """
        data = take_snapshot(self._context)
        if self._recorder is not None:
            self._recorder.note_snapshot(data)
        return data

    def restore(self, data: bytes) -> None:
        """Go back to a state of `snapshot`: what follows is the same, bit for bit, given the same calls.

        Handles of what the state has stay valid, or become so again; handles of what it has not are dead, as
        if that had been removed. For what it has and nobody holds a handle to, `bodies` and `colliders` have
        new ones. A force field stays as it is. Those who listen to events go on to; watched stress is as it
        was, and what else is watched now stays so. Events of undone steps that wait are dropped: when the
        steps are made again, they come again, and so do those that were drained before.
        Raises: SnapshotError for what is damaged, or of a world that was built of other things, with the
            first that differs; OptionError for what is not bytes; StateError before `build`.
        """
        restore_snapshot(self._context, data)
        self._restore_count += 1
        if self._recorder is not None:
            self._recorder.go_back(self._context, data)

    @property
    def restore_count(self) -> int:
        """How often `restore` was called: whoever keeps earlier states sees that they are of another past."""
        return self._restore_count

    def state_hash(self) -> str:
        """A name of the state, 16 hexadecimal digits: the same in two worlds that are in step.

        Made of step count, positions, velocities, pins, who lives, sleeps or is frozen, colliders, frames,
        grabs and joints; the same for any number of threads.
        Raises: StateError before `build`.
        """
        return state_hash(self._context)

    def save_recording(self, path: str | Path) -> Path:
        """Write what was done in the last `record` steps or more, and the snapshot before them, to a file.

        Steps that `restore` has undone are not in it, and do not count; where it went to a state that was
        not kept here, the recording begins again there.
        `taichi-soft replay FILE` makes it again anywhere, bit by bit on a machine like this one. The file
        holds the assets and shapes as well, and the accelerations that a force field gave, but no code.
        Returns: the path.
        Raises: StateError without `record` or before `build`; SnapshotError where the file cannot be written.
        """
        _ = self._built
        if self._recorder is None:
            raise StateError("this world records nothing: make it with World(record=240)")
        return self._recorder.save(self._context, path)


def context_of_world(world: World) -> WorldContext:
    """What is behind its public face, for what the library builds upon it."""
    return world._context
