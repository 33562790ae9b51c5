"""The world: add bodies, build, step, read."""

from __future__ import annotations

import warnings
from pathlib import Path

from numpy.typing import ArrayLike

from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.slots import Pools
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.colliders import MOST_SAMPLES
from taichi_soft.control.change import require_substeps
from taichi_soft.control.drives import ForceField, push_by_field, require_field
from taichi_soft.core.checks import as_count, as_flag, as_friction, as_gravity, as_number, as_path
from taichi_soft.core.clock import Clock
from taichi_soft.core.constants import GRAVITY_EARTH, VELOCITY_LIMIT
from taichi_soft.core.errors import DroppedEventsWarning, FrozenBodyWarning, StateError
from taichi_soft.core.handles import Handles, recorded, serial_of
from taichi_soft.core.settings import ContactSettings, Settings
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
"""A thousand times as many substeps as were asked for."""


class World(WorldBodies, WorldControl, WorldQueries, WorldEvents, WorldStates):
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
        tolerance: of implicit solves, residual over the load on the body: 1e-6 to 0.5.
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
        soft_contact: bool = False,
        sleep_speed: float = 0.0,
        collider_room: int = 0,
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
            has_stable_step=INTEGRATORS[settings.integrator].has_stable_step,
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
            make_handle=make_handle,
            contact=touching,
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
        """Gravity, floor, integrator and schedule, as they were checked, chosen, or set since."""
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
    def is_built(self) -> bool:
        """True from `build` on."""
        return self._context.fields is not None

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

    def stable_substeps(self, dt: float) -> int:
        """Number of substeps that a fixed step of `dt` [s] needs, with a margin, for the stiffest asset.

        Of all that have slots, whether a body lives there or not: so that neither the time of a frame nor the
        motion of the others changes where one comes or goes. Bodies that were cut, or given another material,
        count with an estimate of their own after each change, which takes some 35 ms for 5,000 tetrahedra and
        several times as much with `damping`: give substeps where that is too long. 1 for implicit Euler,
        which needs none; with `soft_contact` so many that they last no longer than 1/240 s.
        Args:
            dt: length of the fixed step [s], above 0.
        """
        return self._context.substeps.stable_count(dt)

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make one fixed step of `dt` [s] in `substeps` equal substeps; None chooses their number.

        A body that goes non-finite is put back to where it was before the step and frozen, with a
        `FrozenBodyWarning` and `body.failure`; the other bodies go on. Before, it and what it may touch make
        the step again with up to eight times the substeps, by `World(retries=3)`.
        Ctrl-C lets a step of less than about 0.03 s end first. It ends a longer one within a second, and the
        world is as before that step.
        Args:
            dt: length of the fixed step [s], above 0.
            substeps: number of equal substeps, 1 or more; None chooses it by `stable_substeps`.
        Warns: FrozenBodyWarning; UnstableStepWarning for substeps longer than the stable step of the stiffest
            asset; SlowStepWarning as `build`, once in a world; SolverWarning of inexact solves by implicit
            Euler, and once of a body that has had tetrahedra inside out for 120 steps.
        Raises: OptionError if dt is not a positive number or substeps not a positive whole one, and where
            there are more than `max_substeps`; StateError before `build`.
        Example:
            world.step(1 / 60)  # as many substeps as stability needs
            world.step(1 / 60, substeps=10)  # the same cost in every frame
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
            reports += self._recorder.record_step(self._context, seconds, count, has_failure=bool(reports))
        if reports:
            warnings.warn("; ".join(reports), FrozenBodyWarning, stacklevel=3)
        if simulation.loss:
            warnings.warn(simulation.loss, DroppedEventsWarning, stacklevel=3)
        if simulation.troubled:
            simulation.check_shapes()
            simulation.check_solves()

    def _push(self) -> None:
        """Let the force field act in the coming step, if there is one."""
        if self._force_field is not None:
            rows = push_by_field(self._context, self._force_field)
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
        """One that Ctrl-C may end, and then all is as before."""
        before = take_snapshot(self._context)
        try:
            self._push()
            return simulation.step(seconds, substeps, h)
        except KeyboardInterrupt:
            restore_snapshot(self._context, before, keeps_events=True)
            raise

    @recorded
    def warm_up(self) -> None:
        """Compile all that a game may call, behind its loading screen, so that nothing stops it later.

        Without it each kind of call compiles where it is made first: for 0.1 to 1 s with an empty cache, for
        less in a later process; a first step with contact and a first `Body.watch_stress`, for many seconds.
        A terminal is told what is being compiled. The world stays as it is, to the bit. `Body.failure` of a
        body that froze is left out: every start would pay for what hardly any body needs.
        Raises: StateError before `build`.
        """
        warm_up(self._context)

    @recorded
    def wake(self) -> None:
        """Wake all bodies that sleep."""
        if self._context.fields is not None:
            self._context.fields.wake_all()

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


def context_of_world(world: World) -> WorldContext:
    """What is behind its public face, for what the library builds upon it."""
    return world._context


def force_field_of(world: World) -> ForceField | None:
    """What `set_force_field` was given last."""
    return world._force_field
