"""Class `World`, with the methods that build a world and run its steps."""

from __future__ import annotations

import warnings
from pathlib import Path

from numpy.typing import ArrayLike

from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.slots import Pools
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.colliders import MOST_SAMPLES
from taichi_soft.control.change import require_per_body
from taichi_soft.control.drives import ForceField, apply_force_field, require_field
from taichi_soft.core.checks import as_count, as_flag, as_friction, as_gravity, as_number, as_path
from taichi_soft.core.clock import Clock
from taichi_soft.core.conflicts import FLAT_SOLVES
from taichi_soft.core.constants import GRAVITY_EARTH, VELOCITY_LIMIT
from taichi_soft.core.errors import DroppedEventsWarning, FrozenBodyWarning, OptionError, StateError
from taichi_soft.core.handles import Handles, recorded, serial_of
from taichi_soft.core.settings import ContactRequest, Settings
from taichi_soft.core.signals import Whole
from taichi_soft.core.types import Integrator, IntegratorName, Schedule, ScheduleName
from taichi_soft.persistence.recorder import Recorder
from taichi_soft.persistence.snapshot import restore_snapshot, take_snapshot
from taichi_soft.solver.context import WorldContext
from taichi_soft.solver.integrators import INTEGRATORS
from taichi_soft.solver.simulation import Simulation
from taichi_soft.solver.substeps import Substeps
from taichi_soft.world.body import Body
from taichi_soft.world.building import build
from taichi_soft.world.spawning import make_handle
from taichi_soft.world.warm_up import warm_up
from taichi_soft.world.world_bodies import WorldBodies
from taichi_soft.world.world_control import SLICES, WorldControl
from taichi_soft.world.world_events import WorldEvents
from taichi_soft.world.world_queries import WorldQueries
from taichi_soft.world.world_states import WorldStates

MOST_RETRIES = 10
"""Largest value of `retries`. The last of 10 retries has 1,024 times the requested substeps."""


class World(WorldBodies, WorldControl, WorldQueries, WorldEvents, WorldStates):
    """World of soft bodies under gravity, above a floor. All units are SI units, and z points up.

    By default bodies touch each other and fall asleep, and colliders can be added after `build`. For an
    experiment that sleep or contact between bodies would disturb, turn these features off:
    `World(soft_contact=False, sleep_speed=0, collider_room=0)`. The schedule "flat" and the integrator
    "explicit_euler" support none of these features, so the features are off by default with "flat" and
    "explicit_euler". The schedule "auto" chooses "flat" for a single large body.

    Any thread can call a world and its handles, but only one at a time. A concurrent call raises a StateError
    that names both threads, and changes nothing. A call in a process that was forked after Taichi started
    also raises a StateError.

    Args:
        gravity: acceleration of gravity, (3,) [m/s^2].
        floor: height of a horizontal floor [m], or None for a world without a floor.
        restitution: restitution of the floor, 0 to 1, as in `add_collider`; None applies only the elasticity
            of the bodies. With the schedule "flat", the floor reflects each vertex separately, and the
            default is 0. With 0, only the elasticity of the bodies acts, and a damped body can bounce higher
            than with 1.
        friction: Coulomb coefficient of the floor, 0 or more.
        integrator: "leapfrog", "lazy_leapfrog", "explicit_euler" or "implicit_euler". "implicit_euler" is
            stable for every step, but solves a linear system per step, and its damping grows with the step.
            If an edge would change by more than half its length, the step is divided into 2 to 32 parts.
        tolerance: largest residual of implicit solves, divided by the load on the body, 1e-6 to 0.5.
        most_iterations: largest number of iterations of an implicit solve. If a solve needs more, the last
            iterate is used, with a `SolverWarning`.
        schedule: "auto", "per_body" or "flat", the loop structure of the computation. It does not change the
            physics.
        soft_contact: True for contact between soft bodies. None means True if bodies can touch: if
            there is more than one slot for bodies, or an asset whose bodies touch themselves.
        sleep_speed: largest speed for sleep [m/s]. A body falls asleep after its particles, and the particles
            of all bodies that it can touch, have been slower for 0.5 s. The body wakes when something
            approaches it or acts on it. None means 0.02 m/s; 0 turns sleep off.
        collider_room: least number of colliders that can be added after `build`. None means 15.
        sample_room: number of grid samples for colliders that are added after `build`. A `HeightFieldShape`
            or `MeshShape` uses `len(shape.samples)` of them while its collider exists.
        retries: number of retries of a step that fails for a body. Each retry has twice the substeps. One
            more retry damps the vibrations of the body. 0 freezes the body at once, for example to study a
            law at a given step. Implicit Euler ignores this number and divides failing steps.
        max_substeps: largest number of substeps of a step. If 1/60 s needs more substeps, `build` raises an
            error; if a step needs more, `step` raises an error. None only warns above 500 substeps.
        record: number of steps that the flight recorder stores, with all calls between them; 0 turns the
            recorder off. See `save_recording`.
        record_to: file that the flight recorder writes when a body freezes for the first time.
    Raises: OptionError for a value out of range or an unknown name.
    Example:
        arena = World(floor=0.0)
        cube = arena.add_body(box(), jelly, position=(0, 0, 2))
        arena.build()
        for frame in range(60):
            arena.step(1 / 60)
            vertices = cube.positions()  # draw them
    """

    def __init__(
        self,
        *,
        gravity: ArrayLike = (0.0, 0.0, -GRAVITY_EARTH),
        floor: float | None = 0.0,
        restitution: float | None = None,
        friction: float = 0.5,
        integrator: IntegratorName = Integrator.LEAPFROG,
        tolerance: float = 1e-3,
        most_iterations: int = 200,
        schedule: ScheduleName = Schedule.AUTO,
        soft_contact: bool | None = None,
        sleep_speed: float | None = None,
        collider_room: int | None = None,
        sample_room: int = 0,
        retries: int = 3,
        max_substeps: int | None = None,
        record: int = 0,
        record_to: str | Path = "frozen.recording",
    ) -> None:
        settings = Settings(
            gravity=as_gravity(gravity),
            floor=None if floor is None else as_number(floor, "floor", -1e6, 1e6, "a height [m] or None"),
            restitution=None
            if restitution is None
            else as_number(restitution, "restitution", 0.0, 1.0, "a number from 0 to 1, or None"),
            friction=as_friction(friction),
            integrator=Integrator.parse(integrator),
            tolerance=as_number(tolerance, "tolerance", 1e-6, 0.5),
            most_iterations=as_count(most_iterations, "most_iterations"),
            retries=as_count(retries, "retries", 0, MOST_RETRIES),
            schedule=Schedule.parse(schedule),
        )
        model = INTEGRATORS[settings.integrator]
        if model.takes_solves and settings.schedule is Schedule.FLAT:
            raise OptionError(FLAT_SOLVES.message())
        self._handles, self._serial = Handles(), 0
        self._record, self._record_to = as_count(record, "record", 0), as_path(record_to)
        request = ContactRequest(
            soft=None if soft_contact is None else as_flag(soft_contact, "soft_contact"),
            sleep_speed=None
            if sleep_speed is None
            else as_number(
                sleep_speed, "sleep_speed", 0.0, VELOCITY_LIMIT, "a speed of 0 m/s or more, or None"
            ),
            collider_room=None if collider_room is None else as_count(collider_room, "collider_room", 0),
            sample_room=as_count(sample_room, "sample_room", 0, MOST_SAMPLES),
        )
        pools: Pools[SoftBody] = Pools()
        substeps = Substeps(
            pools,
            has_stable_step=model.has_stable_step,
            soft_contact=request.soft,
            most=None if max_substeps is None else as_count(max_substeps, "max_substeps"),
        )
        self._context = WorldContext(
            settings=settings,
            clock=Clock(),
            handles=self._handles,
            slots=pools,
            layout=Scene(),
            renew_substeps=substeps.renew,
            make_handle=make_handle,
            contact_request=request,
            substeps=substeps,
            make_body=Body,
        )
        self._context.slices += [kind(self._context) for kind in SLICES]
        self._force_field: ForceField | None = None
        self._recorder: Recorder | None = None
        self._restore_count = 0

    def __repr__(self) -> str:
        kinds = [
            f"{len(self.bodies)} bodies",
            f"{len(self.colliders)} colliders",
            f"t = {self.time:g} s" if self.is_built else "not built",
        ]
        return f"World({', '.join(kinds)})"

    @property
    def settings(self) -> Settings:
        """Current settings: gravity, floor, integrator and schedule."""
        return self._context.settings

    @property
    def step_count(self) -> int:
        """Number of fixed steps that the world has made."""
        return self._context.clock.steps

    @property
    def time(self) -> float:
        """Simulated time since the start of the world [s]."""
        return self._context.clock.time

    @property
    def last_dt(self) -> float:
        """Length of the last fixed step [s]; 0 before the first step."""
        return self._context.clock.last_dt

    @property
    def is_built(self) -> bool:
        """True after `build`."""
        return self._context.fields is not None

    def build(self) -> None:
        """Start Taichi if it is not running, allocate fields for all bodies, and choose the kernels.

        Warns: SlowStepWarning with the cause if 1/60 s takes more than 500 substeps; TooSoftWarning for
            bodies that collapse under their weight.
        Raises: StateError in a world without bodies and for a second call; OptionError for a body that starts
            inside a collider, or if 1/60 s takes more substeps than `max_substeps`.
        """
        if self.is_built:
            raise StateError("the world is already built")
        self._context.fields = build(self._context)
        self._context.settings = self._context.fields.settings
        if self._record:
            self._handles.recorder = self._recorder = Recorder(self._context, self._record, self._record_to)

    def stable_substeps(self, dt: float) -> int:
        """Number of substeps that a fixed step of `dt` [s] needs for the stiffest asset, with a margin.

        The number considers all assets with slots, even empty slots, so that spawning changes neither the
        time of a frame nor the motion of other bodies. After a cut or a change of material, the stable step
        of the changed body is estimated again (about 35 ms for 5,000 tetrahedra, several times as long with
        `damping`). Steps with `substeps` avoid this estimate. With implicit Euler, the number is 1; if bodies
        can touch, it is the smallest number with substeps of at most 1/240 s.
        Args:
            dt: length of the fixed step [s], above 0.
        """
        return self._context.substeps.stable_count(dt)

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make one fixed step of `dt` [s].

        If a body becomes non-finite, the step is retried for the body and all bodies that it can touch, with
        up to eight times the substeps (`World(retries=3)`). If all retries fail, the body is frozen in its
        state before the step, with a `FrozenBodyWarning` and `body.failure`; other bodies continue.

        On Ctrl-C, a step of less than about 0.03 s is completed. A longer step stops within a second, and the
        state before it is restored.
        Args:
            dt: length of the fixed step [s], above 0.
            substeps: number of equal substeps, 1 or more; None uses `stable_substeps`.
        Warns: FrozenBodyWarning; UnstableStepWarning for substeps longer than the stable step of the stiffest
            asset; SlowStepWarning as in `build`, once per world; SolverWarning for inexact solves of implicit
            Euler, and once for each body that has had inverted tetrahedra for 120 steps.
        Raises: OptionError if dt is not a positive number, substeps is not a positive integer, or more than
            `max_substeps` are needed; StateError before `build`.
        Example:
            world.step(1 / 60)  # the stable number of substeps
            world.step(1 / 60, substeps=10)  # the same cost in every frame
        """
        simulation = self._context.fields or self._built  # raises an error before `build`
        seconds, count, h = self._context.substeps.choose(dt, substeps)
        if count > simulation.long_from:
            reports = self._make_long_step(simulation, seconds, count, h)
        else:
            self._push()
            with Whole():
                reports = simulation.step(seconds, count, h)
        if self._recorder is not None:
            reports += self._recorder.record_step(self._context, seconds, count, has_failure=bool(reports))
        if reports:
            warnings.warn("; ".join(reports), FrozenBodyWarning, stacklevel=3)
        if simulation.loss:
            warnings.warn(simulation.loss, DroppedEventsWarning, stacklevel=3)
        if simulation.troubled:
            simulation.check_shapes()
            simulation.check_solves()

    def _push(self) -> None:
        """Apply the force field, if there is one, to the next step."""
        if self._force_field is not None:
            rows = apply_force_field(self._context, self._force_field)
            if self._recorder is not None:
                self._recorder.field_accelerations = [
                    (serial_of(body), accelerations) for body, accelerations in rows
                ]

    def _keep(self) -> bytes | None:
        if self._force_field is None and not self._context.substeps.has_limit:
            return None
        return self.snapshot()

    def _undo(self, data: bytes) -> None:
        restore_snapshot(self._context, data, keeps_events=True)
        if self._recorder is not None:
            self._recorder.rewind(self._context, data)

    def _make_long_step(self, simulation: Simulation, seconds: float, substeps: int, h: float) -> list[str]:
        """Make a step that Ctrl-C can interrupt. On Ctrl-C, restore the state before the step."""
        before = take_snapshot(self._context)
        try:
            self._push()
            return simulation.step(seconds, substeps, h)
        except KeyboardInterrupt:
            restore_snapshot(self._context, before, keeps_events=True)
            raise

    @recorded
    def warm_up(self) -> None:
        """Compile all kernels that a game can call, to avoid pauses later.

        Call this for example behind a loading screen. Otherwise, the first call of each method compiles
        kernels, which takes 0.1 s to 1 s with an empty cache, and less in later processes. The first step
        with contact and the first `Body.watch_stress` take many seconds. Progress is shown in a terminal. The
        world's state stays bit-identical. The kernels of `Body.failure` are not compiled, because they are
        rarely needed.

        Raises: StateError before `build`.
        """
        warm_up(self._context)

    @recorded
    def wake(self) -> None:
        """Wake all sleeping bodies."""
        if self._context.fields is not None:
            self._context.fields.wake_all()

    def set_force_field(self, function: ForceField | None) -> None:
        """Accelerate all bodies by a function of position and time. None removes the function.

        Args:
            function: (positions float32 (n, 3) [m], time [s]) -> accelerations (n, 3) [m/s^2], called once
                per step for each body that is not frozen. The accelerations act during the whole step. If the
                function raises an error or returns an invalid result, `step` raises an error and makes no
                step.
        Raises: OptionError for an argument that is not callable; StateError with schedule "flat".
        """
        field = require_field(function)
        _ = self._built
        require_per_body(self._context, "force field")
        self._force_field = field


def context_of_world(world: World) -> WorldContext:
    """Return the internal context of a world, for other modules of the library."""
    return world._context


def force_field_of(world: World) -> ForceField | None:
    """Return the current force field of a world."""
    return world._force_field
