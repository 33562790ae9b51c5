"""Fields and step kernel of a built world, and the Python part of a step."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.failure import FailedStep, Failure
from taichi_soft.bodies.kernels.readout import write_motion
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.slots import Pools
from taichi_soft.bodies.soft_body import SoftBody, present_asset, record_of
from taichi_soft.bodies.status import ABSENT, ASLEEP, FROZEN
from taichi_soft.contact.clearance import require_clear
from taichi_soft.contact.colliders import Colliders
from taichi_soft.contact.filters import filter_of
from taichi_soft.contact.kernels.parting import mark_placed
from taichi_soft.control.attachments import Attachments
from taichi_soft.control.easing import Easings
from taichi_soft.control.frames import Frames
from taichi_soft.control.joints import Joints
from taichi_soft.control.pins import pinned_vertices
from taichi_soft.core.clock import Clock
from taichi_soft.core.constants import POSITION_LIMIT, VELOCITY_LIMIT
from taichi_soft.core.errors import OptionError, SolverWarning
from taichi_soft.core.residue import rounding_error
from taichi_soft.core.settings import Settings
from taichi_soft.events import EventLog
from taichi_soft.fracture.tearing import Tears
from taichi_soft.solver.failures import find_failure
from taichi_soft.solver.kernels.islands import list_joined_islands, read_islands
from taichi_soft.solver.kernels.skipping import begin_skips, end_skips, skip_bodies
from taichi_soft.solver.kernels.sleep import wake_body, wake_near
from taichi_soft.solver.kernels.spawn import despawn_body, disable_body, enable_body, spawn_body
from taichi_soft.solver.kernels.step import ALL_SLEEP
from taichi_soft.solver.kernels.untangling import REPORTED_AFTER
from taichi_soft.solver.program import StepProgram
from taichi_soft.solver.readout import Readout
from taichi_soft.solver.schedules import Launch
from taichi_soft.solver.state import State


@dataclass(eq=False)
class Simulation:
    """A built world without its public interface."""

    settings: Settings
    pools: Pools[SoftBody]
    scene: Scene
    clock: Clock
    frames: Frames
    easings: Easings
    joints: Joints
    colliders: Colliders | None  # None in a world without contact
    sleeps: bool  # True if bodies fall asleep
    state: State
    program: StepProgram
    launch: Launch
    long_from: int  # steps with more substeps need several kernel calls
    events: EventLog
    tears: Tears
    readout: Readout = field(init=False)
    loss: str = ""  # message about events that the last step lost; "" if there is none to report
    troubled: int = 0  # number of bodies that failed, inverted or were solved inexactly in the last step
    _skips: bool = True  # True if bodies can skip the next step
    _is_still: bool = False  # True if no body is awake and nothing has changed after the last step
    _warned: set[int] = field(default_factory=set)  # slots whose inexact solves were reported
    _inverted: set[int] = field(default_factory=set)  # slots whose inverted tetrahedra were reported

    def __post_init__(self) -> None:
        self.readout = Readout(self.settings, self.state, self.program, self.scene, self.joints)

    def step(self, seconds: float, substeps: int, h: float) -> list[str]:
        """Run one fixed step of `seconds` [s] in `substeps` substeps of `h` [s].

        Returns: a message for each body that the step froze.
        """
        clock, colliders = self.clock, self.colliders
        if self.easings.by_body:
            self.easings.advance(seconds)
        self.frames.aim(self.state, len(self.pools.slots), seconds)
        goes_on = not self._is_still or self.frames.has_work
        if colliders is not None:
            goes_on = colliders.prepare(seconds) or goes_on
        if goes_on:
            self.readout.has_moved()
            if self._skips and self.program.has_contact:
                begin_skips(self.state, len(self.pools.slots))
            found = self.launch(substeps, h)
            self.troubled, self._is_still = max(found, 0), found == ALL_SLEEP
        if colliders is not None:
            colliders.finish(seconds)
        reports = self._record_failures(substeps, h) if self.troubled else []
        clock.steps += 1
        clock.time += seconds
        clock.last_dt = seconds
        self.loss = self.events.collect(clock.steps - 1, clock.time, seconds)
        if goes_on:
            self._break_overloaded(seconds)
        if self._skips:
            skipped = end_skips(self.state, len(self.pools.slots))
            self._is_still, self._skips = self._is_still and not skipped, False
        for body, pieces in self.tears.tear():
            self.events.record_torn(clock.steps - 1, clock.time, body, pieces)
        return reports

    def _break_overloaded(self, seconds: float) -> None:
        """Release the joints and attachments that broke in the last step, and record the events."""
        step, time = self.clock.steps - 1, self.clock.time
        for joint, impulse in self.joints.break_overloaded(seconds):
            self.events.record_broken(step, time, joint, impulse)
        if self.frames.attachments:
            for attachment, impulse in self.joints.context.of(Attachments).break_overloaded(seconds):
                self.events.record_broken(step, time, attachment, impulse)

    def trial_step(self, seconds: float) -> None:
        """Run a step of one substep without recording events. The caller must then undo the step."""
        self.frames.aim(self.state, len(self.pools.slots), seconds)
        if self.colliders is not None:
            self.colliders.prepare(seconds)
            begin_skips(self.state, len(self.pools.slots))
        self.launch(1, seconds)
        end_skips(self.state, len(self.pools.slots))
        self.state.body_status.to_numpy()  # compiles the kernel that reads after a failure
        self.state.body_patience.to_numpy()  # compiles the kernel that finds inverted bodies

    def _record_failures(self, substeps: int, h: float) -> list[str]:
        """Record the bodies that the last step froze. Returns: a message for each frozen body."""
        clock, reports = self.clock, []
        # Only the last attempt freezes bodies, so record the substeps of that attempt.
        finer, is_braked = 1 << self.settings.retries, self.settings.retries > 0
        if self.program.integrator.halvings > 0:
            finer, is_braked = 1 << self.program.integrator.halvings, False
        status = self.state.body_status.to_numpy()
        for body in self.pools.occupants:
            if status[body.index] != FROZEN or body.is_frozen:
                continue
            record_of(body).frozen_in = FailedStep(
                clock.steps, clock.time, finer * substeps, h / finer, is_braked
            )
            self.events.record_frozen(body)
            reports.append(
                f"body {body.index} went non-finite in step {clock.steps}: restored to t = "
                f"{clock.time:.4g} s and frozen; see body.failure. {self._suggest_fix(body)}"
            )
        return reports

    def _suggest_fix(self, body: SoftBody) -> str:
        """Return advice to the user for a body that the last step froze."""
        lower, upper = body.aabb()
        moved, size = self.frames.displacement(body), float((upper - lower).max())
        if moved > size:
            return (
                f"It is {size:.3g} m large, and its frame moved it by {moved:.3g} m in this step: move the "
                "frame by less per step, or jump with Frame.teleport"
            )
        return "Use more substeps or a softer material"

    def check_shapes(self) -> None:
        """Warn once about each body whose tetrahedra stay inverted."""
        patience = self.state.body_patience.to_numpy()
        for body in self.pools.occupants:
            index = body.index
            if patience[index] < REPORTED_AFTER or index in self._inverted or body.is_frozen:
                continue
            self._inverted.add(index)
            warnings.warn(
                f"body {index} has tetrahedra that stay inside out: body.flipped_tets() lists them. Use a "
                "larger Young's modulus, a coarser mesh or mesh.improved()",
                SolverWarning,
                stacklevel=4,
            )

    def check_solves(self) -> None:
        """Warn once about each body whose implicit solves were inexact in the last step."""
        if not self.state.capacity.implicit:
            return
        residuals = self.state.body_residual.to_numpy()
        for body in self.pools.occupants:
            index = body.index
            is_exact = residuals[index] <= self.settings.tolerance
            if is_exact or index in self._warned or body.is_frozen:
                continue
            self._warned.add(index)
            warnings.warn(
                f"the implicit solve of body {index} ended with a residual of {residuals[index]:.2g} instead "
                f"of {self.settings.tolerance:g} within {self.settings.most_iterations} iterations: raise "
                "most_iterations or tolerance, or use more substeps",
                SolverWarning,
                stacklevel=4,
            )

    def fill(self, slot: int, rows: NDArray[np.float32]) -> None:
        """Place a body in an empty slot, with the initial state `rows` (see `SoftBodyAsset.placed`)."""
        spawn_body(self.state, slot, rows, *self.pools.assets[slot].contact.filter)
        self.mark_changed()

    def empty(self, slot: int) -> None:
        """Remove the body in a slot from the fields."""
        self._warned.discard(slot)
        self._inverted.discard(slot)
        self._is_still = False
        despawn_body(self.state, slot)

    def switch(self, body: SoftBody, is_on: bool) -> None:
        """Switch a body off or on, and wake what lies on it or is joined to it."""
        for joint in self.joints.holding(body):
            self.wake((joint.other if joint.body is body else joint.body).index)
        self.wake_near(*self.box_of(body))
        if is_on:
            enable_body(self.state, body.index)
            self.on_placed(body)  # other bodies can have moved into it
            self.frames.has_work = True
        else:
            disable_body(self.state, body.index)
            self.events.end_forbidden_contacts()
        self.mark_joints_changed()
        self.mark_changed()

    def is_enabled(self, slot: int) -> bool:
        """True unless the body in a slot was switched off."""
        return int(self.state.body_status[slot]) < ABSENT

    def skip(self, slots: Sequence[int]) -> None:
        """Make the bodies in `slots` skip the next step."""
        if slots:
            skip_bodies(self.state, np.array(slots, dtype=np.int32))
            self._skips = True
            self.mark_changed()

    def islands(self) -> list[tuple[SoftBody, ...]]:
        """Return the islands of the last step, sorted by slot. A body that was added later or is switched off
        has its own island.
        """
        numbers = np.arange(len(self.pools.slots), dtype=np.int32)
        if self.program.has_contact:
            read_islands(self.state, numbers)
        found: dict[int, list[SoftBody]] = {}
        status = self.state.body_status.to_numpy()
        for body in self.pools.occupants:
            is_alone = record_of(body).first_step == self.clock.steps or status[body.index] > ABSENT
            found.setdefault(-1 - body.index if is_alone else int(numbers[body.index]), []).append(body)
        return [tuple(bodies) for bodies in found.values()]

    def wake(self, slot: int) -> None:
        """Wake the body in a slot, or all bodies if `slot` is -1."""
        self._is_still = False
        if self.sleeps:
            wake_body(self.state, slot)

    def wake_all(self) -> None:
        """Wake all bodies."""
        self.wake(-1)

    def wake_near(self, lower: NDArray[Any], upper: NDArray[Any]) -> None:
        """Wake the bodies that sleep near the box with the corners `lower` and `upper` [m]."""
        if self.sleeps:
            box = np.concatenate([lower, upper]).astype(np.float32)
            if wake_near(self.state, len(self.pools.slots), box):
                self._is_still = False

    def box_of(self, body: SoftBody) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the box around a body, its hull and its contact layer, as lower and upper corner [m]."""
        lower, upper = body.aabb()
        asset = present_asset(body)
        if asset.hull is not None:
            points = asset.touching_points(body.positions().astype(np.float64))
            lower, upper = np.minimum(lower, points.min(axis=0)), np.maximum(upper, points.max(axis=0))
        thickness = asset.surface_row[1]
        return lower - thickness, upper + thickness

    def read(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, first, *arguments)`, which only reads the state, and return its result.

        `first` is the first particle of the body in the slot.
        """
        return kernel(self.state, self.scene.ranges[slot].particles[0], *arguments)

    def change(self, slot: int, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, *arguments)` and return its result. The kernel changes the body in a slot.

        If `slot` is -1, the kernel changes all bodies. All methods that control bodies call this method.
        """
        found = self.attempt(kernel, *arguments)
        self.mark_modified(slot)
        return found

    def attempt(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call `kernel(state, *arguments)`, which can refuse a change, and return its result.

        Sleeping bodies stay asleep until the caller calls `mark_modified`.
        """
        return kernel(self.state, *arguments)

    def mark_modified(self, slot: int) -> None:
        """Wake the body in a slot, or all bodies if `slot` is -1, after their state has changed."""
        self.wake(slot)
        self.mark_changed()

    def write_motion(self, body: SoftBody, positions: NDArray[Any], velocities: NDArray[Any]) -> None:
        """Set positions [m] and velocities [m/s] of a body, (n, 3).

        Raises: OptionError for values out of range.
        """
        x, v = positions.astype(np.float32), velocities.astype(np.float32)
        residues = rounding_error(positions).astype(np.float32)
        for name, rows, limit in (("positions", x, POSITION_LIMIT), ("velocities", v, VELOCITY_LIMIT)):
            if not np.abs(rows).max() < limit:
                raise OptionError(
                    f"{name} must lie within {limit:g} of zero, got up to {np.abs(rows).max():.4g}"
                )
        left = self.box_of(body)
        write_motion(self.state, body.index, x, residues, v)
        self.on_placed(body)
        self.mark_modified(body.index)
        self.wake_near(*left)

    def positions(self, body: SoftBody, alpha: float, out: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Return the vertex positions of a body, interpolated between the last two steps, (n, 3) [m]."""
        return self.readout.positions(body, alpha, out)

    def exact_positions(self, body: SoftBody) -> NDArray[np.float64]:
        """Return the vertex positions of a body in float64, (n, 3) [m]."""
        return self.readout.exact_positions(body)

    def velocities(self, body: SoftBody) -> NDArray[np.float32]:
        """Return the vertex velocities of a body at the time of the positions, (n, 3) [m/s]."""
        return self.readout.velocities(body)

    def rest_inverses(self, body: SoftBody) -> NDArray[np.float64]:
        """Return the inverse edge matrix A^-1 of each tetrahedron's current rest shape, (m, 3, 3) [1/m]."""
        return self.readout.rest_inverses(body)

    def pinned(self, body: SoftBody) -> NDArray[np.int32]:
        """Return the indices of the pinned vertices of a body, ascending."""
        return pinned_vertices(body)

    def require_clear(self, body: SoftBody, points: NDArray[np.float64]) -> None:
        """Raise an OptionError if points of a body's surface, (k, 3) [m], are too deep inside a collider.

        The caller must check the floor separately, because the error for the floor states the missing height.
        """
        if self.colliders is not None:
            others = [each for each in self.colliders.handles if each is not self.colliders.floor]
            require_clear(others, present_asset(body), points, f"body {body.index}", filter_of(body))

    def mark_joints_changed(self) -> None:
        """Rebuild the islands of joined bodies, if the world's steps do not search for islands."""
        if self.program.has_contact and not self.program.has_soft_contact:
            list_joined_islands(self.state, len(self.pools.slots))

    def apply_settings(self, settings: Settings) -> None:
        """Apply changes of gravity or of the floor's friction."""
        self.settings = self.readout.settings = settings
        self.state.write_surroundings(settings)

    def on_placed(self, body: SoftBody) -> None:
        """Make the next step check which other bodies `body` overlaps."""
        if self.program.has_soft_contact:
            mark_placed(self.state, body.index)

    def on_filtered(self) -> None:
        """End the contacts of pairs that may no longer touch, because a group or a mask changed."""
        self.events.end_forbidden_contacts()

    def on_cut(self, body: SoftBody) -> None:
        """Renew the stress watches of a body whose vertices changed."""
        self.events.renew_watches(body)

    def was_restored(self) -> None:
        """Discard cached results after a snapshot was restored."""
        self._skips = True
        self.mark_changed()

    def mark_changed(self) -> None:
        """Discard cached results after the fields changed."""
        self._is_still = False
        self.readout.has_moved()

    def rows_of(self, slot: int, vertices: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the rows in the fields for vertices of the body in a slot, (n,)."""
        rows: NDArray[np.int32] = self.scene.bodies[slot].rank[vertices]
        return (rows + self.scene.ranges[slot].particles[0]).astype(np.int32)

    def is_asleep(self, slot: int) -> bool:
        """True if the body in a slot is asleep."""
        return int(self.state.body_status[slot]) == ASLEEP

    def solve_residual(self, body: SoftBody) -> float | None:
        """Implement `Body.solve_residual`."""
        has_solved = self.state.capacity.implicit and self.clock.steps > record_of(body).first_step
        return float(self.state.body_residual[body.index]) if has_solved else None

    def find_failure(self, slot: int, failed: FailedStep) -> Failure:
        """Return which element of the body in a slot failed first in the step `failed`."""
        return find_failure(self.state, self.program, self.scene, slot, failed)
