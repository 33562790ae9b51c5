"""The world: add bodies, build, step, read."""

from __future__ import annotations

import math
import warnings
import weakref
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.body import Body, Floats32, require_buffer, require_built
from taichi_soft.checks import as_count, as_indices, as_number, as_rotation, as_vector
from taichi_soft.constants import GRAVITY_EARTH, POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.control.access import require_substeps
from taichi_soft.control.drives import ForceField, push_by_field, require_field, set_wind
from taichi_soft.control.frames import Frame, Frames
from taichi_soft.control.grabs import Grab
from taichi_soft.control.impulses import apply_radial_impulse
from taichi_soft.errors import FrozenBodyWarning, OptionError, SolverWarning, StateError, UnstableStepWarning
from taichi_soft.failures import FailedStep, Failure, find_failure
from taichi_soft.kernels.evaluate import compute_body_forces
from taichi_soft.kernels.program import Program
from taichi_soft.kernels.readout import read_positions, read_velocities, write_motion
from taichi_soft.kernels.schedules import Launch, choose_schedule, make_launch
from taichi_soft.laws import ElementModel, element_model, fit_model
from taichi_soft.materials import AnyMaterial
from taichi_soft.meshing import BodyMesh
from taichi_soft.runtime import init
from taichi_soft.scene import BodyArrays, BodyDescription, Ranges, Scene, arrange, require_size
from taichi_soft.settings import Settings
from taichi_soft.stability import StableStep, stable_step
from taichi_soft.state import FROZEN, Capacity, State, acquire, release
from taichi_soft.types import DampingModel, Flips, Integrator, Schedule, Strain

SHORTEST_STEP, LONGEST_STEP = 1e-9, 1e4
"""Fixed steps [s]: shorter ones are lost in float32, longer ones would take days of computing."""

_PLAIN = {float, int, np.float64, type(None)}
"""Types whose values can be compared with those of the last step."""


class World:
    """Soft bodies under gravity, above a floor. SI units, z is up.

    Args:
        gravity: (3,) [m/s^2].
        floor: height of a horizontal floor [m], or None for none.
        restitution: of the floor, 0 (default: bodies bounce by their own elasticity) to 1. It throws each
            vertex back by itself, so a damped body may well bounce lower with it than without.
        friction: Coulomb coefficient of the floor, 0 or more.
        integrator: "leapfrog", "lazy_leapfrog", "explicit_euler", or "implicit_euler": stable for every step,
            at the price of a linear solve in each and of damping that grows with its length. A step in which
            edges would change by more than half their length is made in 2 to 32 pieces.
        tolerance: of implicit solves, residual over right-hand side: 1e-6 to 0.5.
        most_iterations: of an implicit solve; one that needs more goes on as far as it came and is reported
            by a `SolverWarning`.
        schedule: "auto", "per_body" or "flat": in which loops the work runs; no effect on the physics.
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
        self._step_count = 0
        self._time = 0.0
        self._last_dt = 0.0
        self._bodies: list[Body] = []
        self._scene = Scene()
        self._state: State | None = None
        self._program: Program | None = None
        self._launch: Launch | None = None
        self._frames = Frames()
        self._grabs: dict[int, Grab] = {}
        self._force_field: ForceField | None = None
        self._checked_step: tuple[Any, ...] = ()
        self._step_values = (0.0, 0, 0.0)
        self._rows: Floats32 = np.empty((0, 3), dtype=np.float32)
        self._read_alpha: float | None = None  # of what `_rows` holds; None once the world has moved on
        self._warned_steps: set[float] = set()
        self._warned_solves: set[int] = set()
        self._stable_steps: dict[tuple[BodyMesh, AnyMaterial, ElementModel], StableStep] = {}

    @property
    def settings(self) -> Settings:
        """Gravity, floor, integrator and schedule, as they were checked and chosen."""
        return self._settings

    @property
    def _is_implicit(self) -> bool:
        return self.settings.integrator is Integrator.IMPLICIT_EULER

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
        """All bodies, in the order in which they were added."""
        return tuple(self._bodies)

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
    ) -> Body:
        """Add a body before `build`.

        Args:
            mesh: rest shape. A `ParticleMesh` (rope, cloth) takes law "springs".
            material: constants in SI units; a `SpringMaterial` for a `ParticleMesh`.
            law: one of `LAWS`: "virial" (thesis 6.3), "face" (6.2), "st_venant_kirchhoff", "neo_hookean"; and
                along edges "springs" (3.4), "volume_springs" (chapter 5), "cmpm", "cmpm2",
                "best_fitting_plane", "tilted_plane" and "tilted_plane_printed" (chapter 4).
            strain: "linear" (eq. 6.7) or "exact" (square root of U^2); None takes the law's own.
            flips: "tolerant" (the thesis: a mirrored tetrahedron is at rest too), "recover" or "off"; None
                takes the law's own. A law with an energy does what follows from it, and takes no other.
            damping_model: "edge" (eq. 3.9) or "tet_mean" (which section 6.4 rejects: it stops rotation).
            position: where the mesh's origin goes, (3,) [m].
            rotation: about the mesh's origin, matrix (3, 3) or quaternion (x, y, z, w).
            velocity: of the whole body, (3,) [m/s].
            pinned: vertices that stay where they are.
        Returns: a handle.
        Raises: MeshError, MaterialError or OptionError for bad input; StateError after `build`.
        """
        if self.is_built:
            raise StateError("the world is already built: add bodies first, then call build() once")
        model = fit_model(element_model(law, strain, flips, damping_model), mesh, material)
        model.require_integrator(self.settings.integrator)
        description = BodyDescription(
            mesh,
            material,
            model,
            as_vector(position, "position", "m"),
            as_rotation(rotation),
            as_vector(velocity, "velocity", "m/s", VELOCITY_LIMIT),
            as_indices(pinned, "pinned", len(mesh.vertices)),
        )
        require_size(mesh)
        self._require_place(description)
        arrays = arrange(description)
        self._scene.append(arrays)
        body = Body(self, len(self._bodies), description)
        self._bodies.append(body)
        return body

    def _require_place(self, description: BodyDescription) -> None:
        """Raises: OptionError where a body starts out of reach, or below the floor, which would crush it."""
        positions = description.start_positions
        lower, upper = positions.min(axis=0), positions.max(axis=0)
        if not max(np.abs(lower).max(), np.abs(upper).max()) < POSITION_LIMIT:
            raise OptionError(f"position puts the body beyond {POSITION_LIMIT:g} m: stay nearer the origin")
        floor = self.settings.floor
        if floor is not None and lower[2] < floor - 1e-3 * (upper[2] - lower[2]):
            depth = floor - lower[2]
            x, y, z = description.position
            raise OptionError(
                f"the body starts {depth:.4g} m below the floor: position=({x:g}, {y:g}, {z + depth:.6g}) "
                "puts it on the floor, World(floor=None) has none"
            )

    def build(self) -> None:
        """Move all bodies into Taichi fields and fix the kernels. Starts Taichi if nobody has.

        Raises: StateError without bodies or when called twice.
        """
        if self.is_built:
            raise StateError("the world is already built")
        if not self._bodies:
            raise StateError("the world is empty: call add_body before build")
        device = init()
        models = list(dict.fromkeys(body._description.model for body in self._bodies))
        schedule = choose_schedule(self.settings.schedule, self._scene, device, self.settings.integrator)
        capacity = Capacity.of(self._scene, parallel=schedule is Schedule.FLAT, implicit=self._is_implicit)
        program = Program(
            tuple(models),
            self.settings.integrator,
            self.settings.floor is not None,
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
        state.load(self._scene, [models.index(body._description.model) for body in self._bodies])
        chosen = self._settings = replace(self._settings, schedule=schedule)
        state.gravity[None] = chosen.gravity.tolist()
        state.floor[None] = [chosen.floor or 0.0, chosen.restitution, chosen.friction]
        if self._is_implicit:
            state.solver[None] = [chosen.tolerance, chosen.most_iterations]
        self._rows = np.empty((self._scene.particle_count, 3), dtype=np.float32)
        self._program, self._state = program, state
        self._launch = make_launch(schedule, state, program, self._scene, device)

    def stable_step(self, body: Body) -> StableStep:
        """Estimate of the largest stable substep of a body; copies of one body share it.

        Raises: OptionError for what is no body.
        """
        if not isinstance(body, Body):
            raise OptionError(f"body must be one that a world made, got {body!r}")
        described = body._description
        key = (described.mesh, described.material, described.model)
        if key not in self._stable_steps:
            self._stable_steps[key] = stable_step(described.mesh, described.material, described.model)
        return self._stable_steps[key]

    def stable_substeps(self, dt: float) -> int:
        """Number of substeps that a fixed step of `dt` [s] needs, with a margin, for the stiffest body.

        1 for implicit Euler, which needs none.
        """
        if not self._bodies:
            raise StateError("the world is empty: call add_body first")
        if self._is_implicit:
            _as_step(dt)
            return 1
        longest = min(body.stable_step.recommended for body in self._bodies)
        return max(1, math.ceil(_as_step(dt) / longest))

    def step(self, dt: float, substeps: int | None = None) -> None:
        """Make one fixed step of `dt` [s] in `substeps` equal substeps; None chooses their number.

        A body that goes non-finite is put back to where it was before the step and frozen, with a
        `FrozenBodyWarning` and `body.failure`; the other bodies go on.
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
        self._frames.aim(self._state, len(self._bodies), seconds)  # type: ignore[arg-type]
        troubled = self._launch(count, h)  # type: ignore[misc]
        reports = self._note_failures(count, h) if troubled else []
        self._step_count += 1
        self._time += seconds
        self._last_dt = seconds
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
        stiffest = min(self._bodies, key=lambda body: body.stable_step.limit)
        limit = stiffest.stable_step.limit
        if h > limit and h not in self._warned_steps:
            warnings.warn(
                f"substep {h * 1e3:.4g} ms is longer than the {limit * 1e3:.4g} ms that body "
                f"{stiffest.index} can take ({stiffest.stable_step.stiffest}): it may explode. Use "
                f"substeps={self.stable_substeps(seconds)} or leave substeps out",
                UnstableStepWarning,
                stacklevel=3,
            )
            self._warned_steps.add(h)
        return seconds, count, h

    def _check_solves(self) -> None:
        """Warn of the body whose solve was least exact, once per world and body."""
        assert self._state is not None
        residuals = self._state.body_residual.to_numpy()[: len(self._bodies)]
        for index in np.flatnonzero(residuals > self.settings.tolerance):
            if int(index) in self._warned_solves or self._bodies[index].is_frozen:
                continue
            self._warned_solves.add(int(index))
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
        for body in self._bodies:
            if status[body.index] != FROZEN or body.is_frozen:
                continue
            body._frozen_in = FailedStep(self.step_count, self.time, substeps, h)
            reports.append(
                f"body {body.index} went non-finite in step {self.step_count}: put back to t = "
                f"{self.time:.4g} s and frozen; body.failure tells where it broke. Use more substeps or a "
                "softer material"
            )
        return reports

    def _find_failure(self, body: Body, failed: FailedStep) -> Failure:
        assert self._state is not None
        assert self._program is not None
        return find_failure(self._state, self._program, self._scene, body.index, failed)

    def add_frame(self, position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None) -> Frame:
        """A place that the engine moves, to attach bodies to; at any time.

        Args:
            position: of its origin, (3,) [m].
            rotation: matrix (3, 3) or quaternion (x, y, z, w).
        Raises: OptionError for bad numbers.
        """
        return Frame(self._frames, position, rotation)

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
        if getattr(body, "_world", None) is not self:
            raise OptionError(f"body must be one that this world made, got {body!r}")
        if type(alpha) is not float or not 0.0 <= alpha <= 1.0:
            alpha = as_number(alpha, "alpha", 0.0, 1.0, "a number from 0 to 1")
        rows = require_buffer(out, body.vertex_count)
        if self._read_alpha != alpha:
            read_positions(self._state, alpha, self._rows)
            self._read_alpha = alpha
        begin, end = self._scene.ranges[body.index].particles
        rows[:] = self._rows[begin:end]
        return rows

    def _solve_residual(self, body: Body) -> float | None:
        require_built(self.is_built)
        assert self._state is not None
        return float(self._state.body_residual[body.index]) if self._is_implicit and self.step_count else None

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
            floor = self.settings.floor
            if floor is not None:
                # What lies on the floor is carried by it: its velocity already is that after contact.
                acceleration[body.positions()[:, 2] <= floor] = 0.0
            rows += (0.5 * lag * acceleration).astype(np.float32)
        return rows

    def _rows_of(self, body: Body, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Where vertices of a body lie in the fields. Raises: StateError before `build`."""
        require_built(self.is_built)
        rows: NDArray[np.int32] = self._scene.bodies[body.index].rank[vertices]
        return (rows + self._scene.ranges[body.index].particles[0]).astype(np.int32)

    def _redescribe(self, body: Body, description: BodyDescription, arrays: BodyArrays) -> Ranges:
        """Take note that a body is made of something else. Returns where it lies in the fields."""
        body._description = description
        self._scene.bodies[body.index] = arrays
        used = {each._description.material for each in self._bodies}
        self._stable_steps = {key: step for key, step in self._stable_steps.items() if key[1] in used}
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
        return self._change_all(kernel, *arguments)

    def _change_all(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a kernel (state, *arguments) that changes all bodies. Raises: StateError before `build`."""
        require_built(self.is_built)
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


def _as_step(dt: float) -> float:
    return as_number(dt, "dt", SHORTEST_STEP, LONGEST_STEP, "a number above 0 s, from 1e-9 to 1e4")
