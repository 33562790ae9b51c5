"""The world: add bodies, build, step, read."""

from __future__ import annotations

import math
import warnings
import weakref
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.assets import SoftBodyAsset
from taichi_soft.body import Body, Floats, Floats32, require_buffer, require_built
from taichi_soft.checks import as_count, as_flag, as_number, as_path, as_vector
from taichi_soft.colliders import Collider, Colliders
from taichi_soft.constants import ALL_GROUPS, GRAVITY_EARTH, POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.contact import DEFAULT_CONTACT, Contact
from taichi_soft.contact_fields import ContactCapacity
from taichi_soft.control.access import require_substeps
from taichi_soft.control.drives import ForceField, push_by_field, require_field, set_wind
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.grabs import Grab
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.cutting import refill_slot, warm_up
from taichi_soft.errors import (
    DroppedEventsWarning,
    FrozenBodyWarning,
    OptionError,
    SolverWarning,
    StateError,
    UnstableStepWarning,
)
from taichi_soft.events import Event, EventLog, Listener, Witness
from taichi_soft.failures import FailedStep, Failure, find_failure
from taichi_soft.handles import Handle, Handles, recorded
from taichi_soft.kernels.evaluate import compute_body_forces
from taichi_soft.kernels.plasticity import read_rest_inverses
from taichi_soft.kernels.program import Program
from taichi_soft.kernels.readout import read_positions, read_velocities, write_motion
from taichi_soft.kernels.schedules import Launch, choose_schedule, make_launch
from taichi_soft.kernels.sleep import wake_body
from taichi_soft.kernels.spawn import despawn_body, spawn_body
from taichi_soft.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh
from taichi_soft.plain import digest_of
from taichi_soft.plasticity import RIGID_ROW, Plasticity
from taichi_soft.pools import Pools
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
from taichi_soft.recorder import Recorder, save_recording
from taichi_soft.runtime import init
from taichi_soft.scene import BodyArrays, BodyDescription, Ranges, Scene
from taichi_soft.settings import Settings
from taichi_soft.shapes import PlaneShape, Shape
from taichi_soft.snapshot import restore_snapshot, state_hash, structure_of, take_snapshot
from taichi_soft.stability import StableStep, stable_step
from taichi_soft.state import ASLEEP, FROZEN, Capacity, State, acquire, release
from taichi_soft.tearing import Tearing, Tears
from taichi_soft.types import DampingModel, Flips, Integrator, Schedule, Strain

SHORTEST_STEP, LONGEST_STEP = 1e-9, 1e4
"""Fixed steps [s]: shorter ones are lost in float32, longer ones would take days of computing."""

MOST_VERTICES = 10_000_000
"""In a world: the constants of the tetrahedra between more would not be counted in 32 bits."""

Happened = TypeVar("Happened", bound=Event)

_PLAIN = {float, int, np.float64, type(None)}
"""Types whose values can be compared with those of the last step."""


class World(Handle):
    """Soft bodies under gravity, above a floor. SI units, z is up.

    Args:
        gravity: (3,) [m/s^2].
        floor: height of a horizontal floor [m], or None for none.
        restitution: of the floor, 0 (default: bodies bounce by their own elasticity) to 1. It throws each
            vertex back by itself, so a damped body may well bounce lower with it than without. With colliders
            or contact between bodies in the world it limits bodies too, as in `add_collider`.
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
        restitution: float = 0.0,
        friction: float = 0.5,
        integrator: str | Integrator = Integrator.LEAPFROG,
        tolerance: float = 1e-3,
        most_iterations: int = 200,
        schedule: str | Schedule = Schedule.AUTO,
        soft_contact: bool = False,
        sleep_speed: float = 0.0,
        collider_room: int = 0,
        record: int = 0,
        record_to: str | Path = "frozen.recording",
    ) -> None:
        downwards = as_vector(gravity, "gravity", "m/s^2")
        downwards.flags.writeable = False
        self._settings = Settings(
            gravity=downwards,
            floor=None if floor is None else as_number(floor, "floor", -1e6, 1e6, "a height [m] or None"),
            restitution=as_number(restitution, "restitution", 0.0, 1.0, "a number from 0 to 1"),
            friction=as_number(friction, "friction", 0.0, 1e6, "a number from 0 to 1,000,000"),
            integrator=Integrator.parse(integrator),
            tolerance=as_number(tolerance, "tolerance", 1e-6, 0.5),
            most_iterations=as_count(most_iterations, "most_iterations"),
            schedule=Schedule.parse(schedule),
        )
        if self._is_implicit and self.settings.schedule is Schedule.FLAT:
            raise OptionError("schedule 'flat' has no implicit_euler: it takes 'per_body' or 'auto'")
        self._handles, self._serial = Handles(), 0
        self._record, self._record_to = as_count(record, "record", 0), as_path(record_to)
        self._built_with: list[str] = []  # shapes of colliders that came before `build`, by digest
        self._colliders = Colliders()
        self._collider_room = as_count(collider_room, "collider_room", 0)
        self._soft_contact = as_flag(soft_contact, "soft_contact")
        self._sleep_speed = as_number(
            sleep_speed, "sleep_speed", 0.0, VELOCITY_LIMIT, "a speed of 0 m/s or more"
        )
        self._floor_collider: Collider | None = None
        self._step_count = 0
        self._time = 0.0
        self._last_dt = 0.0
        self._pools = Pools()
        self._added: dict[tuple[Any, ...], SoftBodyAsset] = {}  # by add_body: copies share one
        self._starts: dict[int, Floats32] = {}  # of bodies that came before build, by slot
        self._scene = Scene()
        self._state: State | None = None
        self._program: Program | None = None
        self._tears: Tears | None = None
        self._launch: Launch | None = None
        self._events: EventLog | None = None
        self._frames = Frames()
        self._grabs: dict[int, Grab] = {}
        self._force_field: ForceField | None = None
        self._checked_step: tuple[Any, ...] = ()
        self._step_values = (0.0, 0, 0.0)
        self._rows: Floats32 = np.empty((0, 3), dtype=np.float32)
        self._read_alpha: float | None = None  # of what `_rows` holds; None once the world has moved on
        self._warned_steps: set[float] = set()
        self._warned_solves: set[int] = set()
        self._stable_steps: dict[BodyDescription, StableStep] = {}  # of bodies with another material

    @property
    def settings(self) -> Settings:
        """Gravity, floor, integrator and schedule, as they were checked and chosen."""
        return self._settings

    @property
    def _is_implicit(self) -> bool:
        return self.settings.integrator is Integrator.IMPLICIT_EULER

    @property
    def _has_contact(self) -> bool:
        return self._program is not None and self._program.has_contact

    @property
    def step_count(self) -> int:
        """Fixed steps made so far."""
        return self._step_count

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    @property
    def last_dt(self) -> float:
        """Length of the last fixed step [s], 0 before the first."""
        return self._last_dt

    @property
    def bodies(self) -> Sequence[Body]:
        """All bodies that live, by the number of their slots: bodies of `add_body` in the order of adding."""
        return self._pools.living

    @property
    def slot_count(self) -> int:
        """Slots for bodies, empty ones among them."""
        return len(self._pools.slots)

    @property
    def is_built(self) -> bool:
        """True from `build` on."""
        return self._state is not None

    def add_body(
        self,
        mesh: BodyMesh,
        material: AnyMaterial,
        *,
        law: str = "virial",
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
        self._require_open()
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
        described = asset.description
        key = (
            id(mesh),
            id(material),
            described.model,
            described.pinned.tobytes(),
            contact,
            plasticity,
            spare_vertices,
            tearing,
        )
        asset = self._added.get(key, asset)
        described.model.require_integrator(self.settings.integrator)
        rows = asset.placed(position, rotation, velocity, (0.0, 0.0, 0.0), self.settings.floor)
        self._add_slot(asset)
        self._added[key] = asset
        return self._enter(asset, rows)

    def reserve(self, asset: SoftBodyAsset, count: int) -> None:
        """Make room for `count` more bodies of an asset, before `build`; `spawn` fills it.

        Empty slots take memory, and no time in a step.
        Raises: OptionError for what is no asset or no count, or an asset that the integrator cannot take;
            StateError after `build`.
        """
        self._require_open()
        _require_asset(asset)
        number = as_count(count, "count")
        asset.description.model.require_integrator(self.settings.integrator)
        vertices = self._scene.particle_count + number * (len(asset.mesh.vertices) + asset.spare_vertices)
        if vertices > MOST_VERTICES:
            raise OptionError(
                f"count is {number:,}: the world would hold {vertices:,} vertices, at most {MOST_VERTICES:,}"
            )
        for _ in range(number):
            self._add_slot(asset)

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
        Raises: OptionError for a value out of range, or a place out of reach or below the floor; StateError
            for an asset without a pool in this world, or whose pool is full.
        """
        _require_asset(asset)
        self._pools.next_slot(asset)
        rows = asset.placed(position, rotation, velocity, angular_velocity, self.settings.floor)
        return self._enter(asset, rows)

    @recorded
    def despawn(self, body: Body) -> None:
        """Take a body out of the world: its slot is free, and its handle dead.

        Raises: OptionError for what is no body of this world; StateError for one that was removed before.
        """
        self._require_own(body)
        if self._state is not None:
            body._let_go()
            self._wake(-1)  # what may have lain on it
        self._pools.leave(body)
        body._removed_in = self.step_count
        self._warned_solves.discard(body.index)
        if self._state is None:
            del self._starts[body.index]
        else:
            despawn_body(self._state, body.index)

    def _require_open(self) -> None:
        if self.is_built:
            raise StateError("the world is already built: add_body and reserve come first, then build() once")

    def _require_own(self, body: Body) -> None:
        """Raises: OptionError for what is no body of this world; StateError for one that was removed."""
        if not isinstance(body, Body) or body._world_ref() is not self:
            raise OptionError(f"body must be one that this world made, got {body!r}")
        body.require_alive()

    def _add_slot(self, asset: SoftBodyAsset) -> None:
        self._scene.append(asset.arrays, asset.spare_vertices)
        self._pools.add_slot(asset)

    def _enter(self, asset: SoftBodyAsset, rows: Floats32) -> Body:
        """A new body in the next free slot, which begins as `rows` say."""
        slot = self._pools.next_slot(asset)
        if self._state is None:
            self._starts[slot] = rows
        else:
            if self._scene.bodies[slot] is not asset.arrays:
                refill_slot(self, self._state, slot)
            spawn_body(self._state, slot, rows)
            self._read_alpha = None
        return self._take_in(asset)

    def _take_in(self, asset: SoftBodyAsset) -> Body:
        """A handle to what is in the next free slot of an asset."""
        body = Body(self, self._pools.next_slot(asset), asset)
        self._handles.enlist(body)
        self._pools.enter(body)
        if self._tears is not None:
            self._tears.watch(body)
        return body

    @property
    def colliders(self) -> Sequence[Collider]:
        """All colliders; from `build` on the floor is among them."""
        return self._colliders.handles

    @property
    def floor_collider(self) -> Collider | None:
        """The floor where there are colliders, from `build` on: to read what bodies do to it."""
        return self._floor_collider

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
        """Add something solid that bodies hit: after `build` where `collider_room` was left for it.

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
        if self.is_built and self._floor_collider is None and not self._colliders.handles:
            raise StateError(
                "the world was built without colliders: add one before build(), or make the world with "
                "collider_room"
            )
        collider = self._colliders.add(
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

        Raises: StateError without bodies or when called twice.
        """
        if self.is_built:
            raise StateError("the world is already built")
        if not self._pools.slots:
            raise StateError("the world is empty: call add_body or reserve before build")
        device = init()
        self._built_with = [digest_of(handle.shape) for handle in self._colliders.all_handles]
        kinds = self._pools.kinds
        models = list(dict.fromkeys(asset.description.model for asset in kinds))
        has_contact = (
            self._soft_contact
            or self._sleep_speed > 0.0
            or len(self._colliders.handles) + self._collider_room > 0
        )
        if has_contact:
            self._require_contact()
        is_cut = any(asset.spare_vertices for asset in kinds)
        if is_cut and self.settings.schedule is Schedule.FLAT:
            raise OptionError(
                "schedule 'flat' cuts no bodies: take 'per_body' or 'auto', or no spare_vertices"
            )
        schedule = choose_schedule(
            self.settings.schedule,
            self._scene,
            device,
            needs_bodies=self._is_implicit or has_contact or is_cut,
        )
        is_plastic = any(asset.plasticity is not None for asset in kinds)
        capacity = Capacity.of(
            self._scene,
            parallel=schedule is Schedule.FLAT,
            implicit=self._is_implicit,
            contact=self._colliders.capacity(self._collider_room, soft=self._soft_contact)
            if has_contact
            else ContactCapacity(),
            plastic=is_plastic,
        )
        program = Program(
            tuple(models),
            self.settings.integrator,
            self.settings.floor is not None and not has_contact,
            has_contact,
            self._soft_contact,
            is_plastic,
            device.threads,
        )
        if self.settings.integrator is Integrator.EXPLICIT_EULER:
            warnings.warn(
                "explicit_euler gains energy at every substep, however short, and explodes sooner or later: "
                "it is here for comparison, leapfrog is for use",
                UnstableStepWarning,
                stacklevel=2,
            )
        state = acquire(capacity)
        weakref.finalize(self, release, state)
        fill, assets = state.loader.fill, self._pools.assets
        if is_plastic:
            flows = [a.plasticity.row if a.plasticity else RIGID_ROW for a in assets]
            fill(state.body_plasticity, np.array(flows))
        if has_contact:
            fill(state.contact.body_filter, np.array([(a.contact.group, a.contact.mask) for a in assets]))
            fill(state.contact.body_edge, np.array([a.surface_row[2] for a in assets]))
        if self._soft_contact:
            fill(state.soft.body_surface, np.array([a.surface_row for a in assets]))
            fill(state.soft.body_touches_itself, np.array([a.contact.itself for a in assets]))
        state.load(self._scene, [models.index(a.description.model) for a in assets])
        self._warm_up(state)
        for slot, rows in self._starts.items():
            spawn_body(state, slot, rows)
        self._starts.clear()
        chosen = self._settings = replace(self._settings, schedule=schedule)
        state.gravity[None] = chosen.gravity.tolist()
        state.floor[None] = [chosen.floor or 0.0, chosen.restitution, chosen.friction]
        if self._is_implicit:
            state.solver[None] = [chosen.tolerance, chosen.most_iterations]
        if has_contact:
            self._colliders.load(state.contact, len(self._pools.slots))
            woken = weakref.WeakMethod(self.wake)  # or the two would keep each other
            self._colliders.on_jump = lambda: (woken() or _do_nothing)()
            state.contact.sleep_speed[None] = self._sleep_speed
        self._rows = np.empty((self._scene.particle_count, 3), dtype=np.float32)
        self._program, self._state = program, state
        self._launch = make_launch(schedule, state, program, self._scene, device)
        colliders = self._colliders if has_contact else None
        self._events = EventLog(Witness(state, self._scene, self._pools.slots, colliders))
        if any(asset.tearing for asset in kinds):
            self._tears = Tears(state, len(self._pools.slots))
            for body in self.bodies:
                self._tears.watch(body)
        if self._record:
            self._handles.recorder = Recorder(self, self._record)

    def _warm_up(self, state: State) -> None:
        """A body that comes and goes, so that nothing compiles where the first does in the game."""
        for asset in self._pools.kinds:
            slot = self._pools.assets.index(asset)
            if asset.spare_vertices:
                warm_up(self, state, slot)
            spawn_body(state, slot, asset.rest_rows)
            despawn_body(state, slot)

    def _require_contact(self) -> None:
        """Make the floor one of the colliders. Raises: OptionError for what takes no colliders."""
        chosen = self.settings
        if chosen.schedule is Schedule.FLAT:
            raise OptionError("schedule 'flat' has no colliders: it takes 'per_body' or 'auto'")
        if chosen.integrator in (Integrator.EXPLICIT_EULER, Integrator.IMPLICIT_EULER):
            raise OptionError(
                f"integrator {chosen.integrator.value!r} takes no colliders: it takes 'leapfrog' or "
                "'lazy_leapfrog'"
            )
        if chosen.floor is not None:
            self._floor_collider = self.add_collider(
                PlaneShape(),
                position=(0.0, 0.0, chosen.floor),
                friction=chosen.friction,
                restitution=chosen.restitution or None,
            )

    def stable_step(self, body: Body) -> StableStep:
        """Estimate of the largest stable substep of a body; bodies of one asset share it until they are cut.

        Raises: OptionError for what is no body.
        """
        if not isinstance(body, Body):
            raise OptionError(f"body must be one that a world made, got {body!r}")
        described = body._description
        if described is body.asset.description:
            return body.asset.stable_step
        if described not in self._stable_steps:
            self._stable_steps[described] = stable_step(described.mesh, described.material, described.model)
        return self._stable_steps[described]

    def stable_substeps(self, dt: float) -> int:
        """Number of substeps that a fixed step of `dt` [s] needs, with a margin, for the stiffest asset.

        Of all that have slots, whether a body lives there or not: so that neither the time of a frame nor the
        motion of the others changes where one comes or goes. Bodies that were cut, or given another material,
        count with an estimate of their own after each change, which takes some 0.2 s for 5,000 tetrahedra:
        give substeps where that is too long. 1 for implicit Euler, which needs none.
        """
        if not self._pools.slots:
            raise StateError("the world is empty: call add_body or reserve first")
        if self._is_implicit:
            _as_step(dt)
            return 1
        longest = min(asset.stable_step.recommended for asset in self._pools.kinds)
        for body in self.bodies:
            if body._description is not body.asset.description:
                longest = min(longest, self.stable_step(body).recommended)
        return max(1, math.ceil(_as_step(dt) / longest))

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make one fixed step of `dt` [s] in `substeps` equal substeps; None chooses their number.

        A body that goes non-finite is put back to where it was before the step and frozen, with a
        `FrozenBodyWarning` and `body.failure`; the other bodies go on. Among colliders, and where bodies may
        touch, it and what it may touch first make the step again with up to eight times the substeps.
        Raises: OptionError if dt is not a positive number or substeps not a positive whole one;
            StateError before `build`.
        """
        if self._launch is None:
            require_built(False)
        asked = (dt, substeps, type(dt), type(substeps))  # 4.0 == 4 and True == 1, but they are refused
        if not {type(dt), type(substeps)} <= _PLAIN or self._checked_step != asked:
            self._step_values = self._check_step(dt, substeps)
            self._checked_step = asked
        seconds, count, h = self._step_values
        self._read_alpha = None
        if self._force_field is not None:
            push_by_field(self, self._force_field)
        self._frames.aim(self._state, len(self._pools.slots), seconds)  # type: ignore[arg-type]
        if self._has_contact:
            self._colliders.prepare(seconds)
        troubled = self._launch(count, h)  # type: ignore[misc]
        if self._has_contact:
            self._colliders.finish(seconds)
        reports = self._note_failures(count, h) if troubled else []
        self._step_count += 1
        self._time += seconds
        self._last_dt = seconds
        loss = self._event_log.collect(self._step_count - 1, self._time, seconds)
        if loss:
            warnings.warn(loss, DroppedEventsWarning, stacklevel=2)
        if self._tears is not None:
            self._tears.tear(self)
        if self._handles.recorder is not None:
            reports += self._handles.recorder.note_step(self, seconds, count, is_broken=bool(reports))
        if reports:
            warnings.warn("; ".join(reports), FrozenBodyWarning, stacklevel=2)
        if troubled and self._is_implicit:
            self._check_solves()

    def _check_step(self, dt: float, substeps: int | None) -> tuple[float, int, float]:
        seconds = _as_step(dt)
        count = as_count(self.stable_substeps(seconds) if substeps is None else substeps, "substeps")
        h = seconds / count
        if self._is_implicit:
            return seconds, count, h
        stiffest = min(self._pools.kinds, key=lambda asset: asset.stable_step.limit)
        limit = stiffest.stable_step.limit
        if h > limit and h not in self._warned_steps:
            warnings.warn(
                f"substep {h * 1e3:.4g} ms is longer than the {limit * 1e3:.4g} ms that body "
                f"{self._pools.assets.index(stiffest)} can take ({stiffest.stable_step.stiffest}): it may "
                f"explode. Use substeps={self.stable_substeps(seconds)} or leave substeps out",
                UnstableStepWarning,
                stacklevel=3,
            )
            self._warned_steps.add(h)
        return seconds, count, h

    def _check_solves(self) -> None:
        """Warn of the body whose solve was least exact, once per world and body."""
        assert self._state is not None
        residuals = self._state.body_residual.to_numpy()
        for body in self.bodies:
            index = body.index
            is_exact = residuals[index] <= self.settings.tolerance
            if is_exact or index in self._warned_solves or body.is_frozen:
                continue
            self._warned_solves.add(index)
            warnings.warn(
                f"the implicit solve of body {index} ended with a residual of {residuals[index]:.2g} instead "
                f"of {self.settings.tolerance:g} within {self.settings.most_iterations} iterations: raise "
                "most_iterations or tolerance, or use more substeps",
                SolverWarning,
                stacklevel=3,
            )

    def _note_failures(self, substeps: int, h: float) -> list[str]:
        """Mark the bodies that the last step froze; a line about each."""
        reports = []
        assert self._state is not None
        status = self._state.body_status.to_numpy()
        for body in self.bodies:
            if status[body.index] != FROZEN or body.is_frozen:
                continue
            body._frozen_in = FailedStep(self.step_count, self.time, substeps, h)
            self._event_log.note_frozen(body)
            reports.append(
                f"body {body.index} went non-finite in step {self.step_count}: put back to t = "
                f"{self.time:.4g} s and frozen; body.failure tells where it broke. Use more substeps or a "
                "softer material"
            )
        return reports

    def _rest_inverses(self, body: Body) -> Floats:
        """A^-1 of each tetrahedron of a body that may have flowed, (m, 3, 3) [1/m], in the caller's order."""
        rows = np.empty((len(body.tets), 3, 3), dtype=np.float32)
        read_rest_inverses(self._state, body.index, rows)
        inverses = np.empty(rows.shape)
        inverses[self._scene.bodies[body.index].tet_order] = rows
        return inverses

    def _find_failure(self, body: Body, failed: FailedStep) -> Failure:
        assert self._state is not None
        assert self._program is not None
        return find_failure(self._state, self._program, self._scene, body.index, failed)

    def _is_asleep(self, body: Body) -> bool:
        return self._state is not None and int(self._state.body_status[body.index]) == ASLEEP

    @recorded
    def wake(self) -> None:
        """Wake all bodies that sleep."""
        self._wake(-1)

    def _wake(self, slot: int) -> None:
        if self._has_contact and self._sleep_speed > 0.0:
            wake_body(self._state, slot)

    @recorded
    def add_frame(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> Frame:
        """A place that the engine moves, to attach bodies to; at any time.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError for bad numbers.
        """
        frame = Frame(self._frames, position, rotation)
        self._handles.enlist(frame)
        return frame

    @recorded
    def grab(
        self,
        origin: ArrayLike,
        direction: ArrayLike,
        *,
        max_distance: float = math.inf,
        frequency: float = 5.0,
        max_force: float | None = None,
    ) -> Grab | None:
        """Take hold of the first body that a ray hits: as `raycast`, and `Body.grab` there.

        Args:
            origin, direction, max_distance: of the ray.
            frequency: of the spring, critically damped [Hz].
            max_force: strongest pull [N]; None for ten times the weight of the body on Earth.
        Returns: a handle to move and release it with, or None where the ray hits nothing.
        Raises: OptionError for numbers out of range; StateError before `build`, under schedule "flat", or
            where all grabs are in use.
        """
        hit = self.raycast(origin, direction, max_distance=max_distance)
        if hit is None:
            return None
        return hit.body.grab(hit.triangle, hit.barycentrics, frequency=frequency, max_force=max_force)

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
        apply_radial_impulse(self, center, impulse, radius)

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
        set_wind(self, velocity, density, drag)

    def set_force_field(self, function: ForceField | None) -> None:
        """Accelerate all bodies by a function of place and time, from now on; None ends it.

        Args:
            function: (positions float32 (n, 3) [m], time [s]) -> accelerations (n, 3) [m/s^2], called once
                per step and body that is not frozen; they act throughout the step. If it raises, or returns
                something else, `step` raises and the step is not made.
        Raises: OptionError for what cannot be called; StateError under schedule "flat".
        """
        field = require_field(function)
        require_built(self.is_built)
        require_substeps(self, "force field")
        self._force_field = field

    def read_positions(self, body: Body, alpha: float, out: Floats32 | None = None) -> Floats32:
        """Positions of a body between the previous step (alpha 0) and the last one (alpha 1), (n, 3) [m].

        The first read after a step copies all bodies at once; further bodies at the same alpha come from
        that copy, because calling a kernel costs more than copying a thousand vertices.
        Raises: OptionError for a body of another world, an alpha out of range or an `out` that does not
            fit; StateError before `build`.
        """
        require_built(self.is_built)
        self._require_own(body)
        if type(alpha) is not float or not 0.0 <= alpha <= 1.0:
            alpha = as_number(alpha, "alpha", 0.0, 1.0, "a number from 0 to 1")
        rows = require_buffer(out, body.vertex_count)
        if self._read_alpha != alpha:
            read_positions(self._state, alpha, self._rows)
            self._read_alpha = alpha
        begin = self._scene.ranges[body.index].particles[0]
        rows[:] = self._rows[begin : begin + body.vertex_count]
        return rows

    def record_events(self, kinds: Iterable[type[Event]] = (Event,)) -> None:
        """Record events of these kinds, and no others, from the next step on, for `drain_events`.

        What touches already counts as a contact that begins in that step.
        Args:
            kinds: classes of events; `Event` stands for all that this world has, an empty list for none.
        Raises: OptionError for what is no class of events; StateError before `build`, and for contacts in a
            world without colliders and soft contact.
        """
        self._event_log.record(kinds)

    def on(self, kind: type[Happened], function: Callable[[Happened], object]) -> Listener:
        """Let a function hear of all events of a kind, and record that kind.

        It is called by `drain_events`, never within a step, so it may do what can be done between two steps.
        Args:
            kind: a class of events; `Event` for all that this world has.
            function: takes the event.
        Returns: what `remove` ends it with.
        Raises: as `record_events`; OptionError for what cannot be called.
        """
        return self._event_log.on(kind, function)

    def drain_events(self) -> list[Event]:
        """All events since the last call, after those who listen have heard of them.

        They come step by step; within a step by kind (contacts begun and ended, stress, tears, sleep, waking,
        freezing), then by the indices of bodies. Up to 10,000 wait, then the oldest are dropped, with a
        `DroppedEventsWarning` in the step.

        An exception of a listener keeps no other from hearing of any event: the first is raised at the end.
        The next call then returns these events with those that came since, and listeners hear of none twice.
        Raises: StateError before `build`, before anything is recorded, and from within a listener.
        """
        return self._event_log.drain()

    @property
    def dropped_events(self) -> int:
        """How many were dropped so far because too many waited."""
        return self._event_log.dropped

    @property
    def _event_log(self) -> EventLog:
        """Raises: StateError before `build`."""
        require_built(self._events is not None)
        assert self._events is not None
        return self._events

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
        return cast_ray(self._built, self._pools.slots, origin, direction, max_distance, bodies, cull_back)

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
        return cast_rays(self._built, self._pools.slots, origins, directions, max_distance, bodies, cull_back)

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
        return find_closest_point(self._built, self._pools.slots, point, max_distance, bodies)

    def overlap_sphere(self, center: ArrayLike, radius: float) -> tuple[Overlap, ...]:
        """Bodies that touch a sphere or enclose it; of a body without triangles its vertices count.

        Args:
            center: (3,) [m].
            radius: above 0 [m].
        Returns: the bodies, in the world's order, each with its vertices in the sphere.
        Raises: OptionError for numbers that are not finite or a radius not above 0; StateError before
            `build`.
        """
        return find_in_sphere(self._built, self._pools.slots, center, radius)

    def overlap_box(
        self, center: ArrayLike, size: ArrayLike, rotation: ArrayLike | None = None
    ) -> tuple[Overlap, ...]:
        """Bodies that touch a box or enclose it; of a body without triangles its vertices count.

        Args:
            center: (3,) [m].
            size: (3,) lengths of its edges, above 0 [m].
            rotation: about its centre, matrix (3, 3) or quaternion (x, y, z, w).
        Returns: the bodies, in the world's order, each with its vertices in the box.
        Raises: OptionError for numbers that are not finite, a size not above 0 or what is no rotation;
            StateError before `build`.
        """
        return find_in_box(self._built, self._pools.slots, center, size, rotation)

    def snapshot(self) -> bytes:
        """The whole state between two steps, to `restore` it here or in a world that was built alike.

        Bodies, colliders, frames, grabs and attachments, the wind, materials that were set, and all that is
        going to act in the coming step are in it; a force field and events are not. It holds numbers only, no
        code. The first call compiles, some seconds at most.
        Raises: StateError before `build`, and where a body was cut or torn.
        """
        return take_snapshot(self)

    def restore(self, data: bytes) -> None:
        """Go back to a state of `snapshot`: what follows is the same, bit for bit, given the same calls.

        Handles of what the state has stay valid, or become so again; handles of what it has not are dead, as
        if that had been removed. For what it has and nobody holds a handle to, `bodies` and `colliders` have
        new ones. A force field stays as it is.
        Raises: SnapshotError for what is damaged, or of a world that was built of other things, with the
            first that differs; OptionError for what is not bytes; StateError before `build`.
        """
        restore_snapshot(self, data)
        if self._handles.recorder is not None:
            self._handles.recorder.begin_again(self)

    def state_hash(self) -> str:
        """A name of the state, 16 hexadecimal digits: the same in two worlds that are in step.

        Made of step count, positions, velocities, pins, who lives, sleeps or is frozen, colliders, frames and
        grabs; the same for any number of threads.
        Raises: StateError before `build`.
        """
        return state_hash(self)

    def save_recording(self, path: str | Path) -> Path:
        """Write what was done in the last `record` steps or more, and the snapshot before them, to a file.

        `taichi-soft replay FILE` makes it again anywhere, bit by bit on a machine like this one. The file
        holds the assets and shapes as well, and the accelerations that a force field gave, but no code.
        Returns: the path.
        Raises: StateError without `record` or before `build`; SnapshotError where the file cannot be written.
        """
        require_built(self.is_built)
        return save_recording(self, path)

    @cached_property
    def _structure(self) -> bytes:
        return structure_of(self)

    @property
    def _built(self) -> State:
        """Raises: StateError before `build`."""
        require_built(self._state is not None)
        assert self._state is not None
        return self._state

    def _solve_residual(self, body: Body) -> float | None:
        require_built(self.is_built)
        assert self._state is not None
        has_solved = self._is_implicit and self.step_count > body._first_step
        return float(self._state.body_residual[body.index]) if has_solved else None

    def _read_velocities(self, body: Body) -> Floats32:
        """Velocities at the time of the positions, (n, 3) [m/s]. Raises: StateError before `build`."""
        require_built(self.is_built)
        assert self._state is not None
        rows = np.empty((body.vertex_count, 3), dtype=np.float32)
        read_velocities(self._state, self._scene.ranges[body.index].particles[0], body.vertex_count, rows)
        lag = float(self._state.body_velocity_lag[body.index])
        if self.settings.integrator is Integrator.LEAPFROG and lag > 0.0 and not body.is_frozen:
            forces = np.empty_like(rows)
            compute_body_forces(self._state, self._program, body.index, forces)
            by_vertex = forces[self._scene.bodies[body.index].rank]
            acceleration = by_vertex / body.masses[:, None] + self.settings.gravity * body.gravity_scale
            acceleration[body.pinned] = 0.0
            acceleration[self._is_carried(body)] = 0.0  # its velocity already is that after contact
            rows += (0.5 * lag * acceleration).astype(np.float32)
        return rows

    def _is_carried(self, body: Body) -> NDArray[np.bool_]:
        """Which vertices of a body touched something in the last substep, (n,)."""
        assert self._state is not None
        if self._has_contact:
            begin = self._scene.ranges[body.index].particles[0]
            touches = self._state.contact.particle_touches.to_numpy()[begin : begin + body.vertex_count]
            return np.asarray(touches[self._scene.bodies[body.index].rank] == 1)
        floor = self.settings.floor
        if floor is None:
            return np.zeros(body.vertex_count, dtype=np.bool_)
        return np.asarray(body.positions()[:, 2] <= floor)

    def _rows_of(self, body: Body, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Where vertices of a body lie in the fields. Raises: StateError before `build`."""
        require_built(self.is_built)
        rows: NDArray[np.int32] = self._scene.bodies[body.index].rank[vertices]
        return (rows + self._scene.ranges[body.index].particles[0]).astype(np.int32)

    def _redescribe(self, body: Body, description: BodyDescription, arrays: BodyArrays) -> Ranges:
        """Take note that a body is made of something else. Returns where it lies in the fields."""
        body._description = description
        self._scene.bodies[body.index] = arrays
        used = {each._description for each in self.bodies}
        self._stable_steps = {key: step for key, step in self._stable_steps.items() if key in used}
        if self._checked_step[1:2] == (
            None,
        ):  # whose number of substeps was chosen for what was there before
            self._checked_step = ()
        return self._scene.ranges[body.index]

    def _gravity_scale(self, body: Body) -> float:
        return 1.0 if self._state is None else float(self._state.body_gravity_scale[body.index])

    def _read(self, body: Body, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, first particle of `body`, *arguments) that changes nothing."""
        return self._read_all(kernel, self._scene.ranges[body.index].particles[0], *arguments)

    def _read_all(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes nothing. Raises: StateError before `build`."""
        require_built(self.is_built)
        return kernel(self._state, *arguments)

    def _change(self, body: Body, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes a body: the way of all control."""
        require_built(self.is_built)
        self._wake(body.index)
        self._read_alpha = None
        return kernel(self._state, *arguments)

    def _change_all(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes all bodies. Raises: StateError before `build`."""
        require_built(self.is_built)
        self._wake(-1)
        self._read_alpha = None
        return kernel(self._state, *arguments)

    def _write_motion(self, body: Body, positions: NDArray[Any], velocities: NDArray[Any]) -> None:
        """Put a body somewhere else. Raises: StateError before `build`."""
        require_built(self.is_built)
        x, v = positions.astype(np.float32), velocities.astype(np.float32)
        for name, rows, limit in (("positions", x, POSITION_LIMIT), ("velocities", v, VELOCITY_LIMIT)):
            if not np.abs(rows).max() < limit:
                raise OptionError(f"{name} must lie within {limit:g} of zero")
        write_motion(self._state, body.index, x, v)
        self._read_alpha = None


def _do_nothing() -> None:
    pass


def _require_asset(asset: SoftBodyAsset) -> None:
    if not isinstance(asset, SoftBodyAsset):
        raise OptionError(f"asset must be a SoftBodyAsset, got {asset!r}")


def _as_step(dt: float) -> float:
    return as_number(dt, "dt", SHORTEST_STEP, LONGEST_STEP, "a number above 0 s, from 1e-9 to 1e4")
