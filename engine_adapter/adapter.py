"""Run a world inside a game loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter.budget import Budget, BudgetStatus
from engine_adapter.fixed_step import Accumulator, FixedStep
from engine_adapter.rollback import Rollback
from taichi_soft import Body, Event, OptionError, RenderMesh, StateError, World
from taichi_soft.core.checks import as_count, as_number
from taichi_soft.core.handles import handles_of
from taichi_soft.core.renamed import warn_renamed
from taichi_soft.core.threads import one_thread


class EngineAdapter:
    """Runs a built world in fixed steps at any frame rate, and interpolates the positions to draw.

    While an adapter is in use, no other code must step or restore its world, because `alpha` and `time` count
    the adapter's steps. Only one thread at a time can call an adapter. The same holds for a world.

        adapter = EngineAdapter(world, FixedStep(dt=1 / 60))
        while running:
            adapter.advance(seconds_since_last_frame)
            adapter.positions(body, out=vertex_buffer)

    Args:
        world: a built world.
        fixed_step: length of a step, its substeps, and the largest number of steps per frame.
        before_step: function that the adapter calls with the world before every fixed step. Move colliders
            and frames, apply forces and grab here, so that the result does not depend on the frame rate.
        rewind_ticks: largest number of steps that `rewind` can undo; 0 turns `rewind` off.
        budget_ms: time budget of a fixed step including changes of level [ms]. If steps take longer, bodies
            with levels of detail get coarser, the farthest first (see `see_from`). If that is not enough, the
            farthest bodies skip steps. When steps take less time again, the adapter reverts these changes.
            See `budget_status`. None turns the budget off.
    Raises: StateError if the world is not built; OptionError if `fixed_step` is not a FixedStep, or
        `before_step` cannot be called.
    Example:
        game = EngineAdapter(world, FixedStep(dt=1 / 60))
        vertices = np.empty((body.vertex_count, 3), np.float32)
        for frame in range(3):
            game.advance(1 / 75)  # seconds since the last frame
            game.positions(body, out=vertices)  # between the last two steps
    """

    def __init__(
        self,
        world: World,
        fixed_step: FixedStep | None = None,
        *,
        before_step: Callable[[World], object] | None = None,
        rewind_ticks: int = 0,
        budget_ms: float | None = None,
    ) -> None:
        fixed_step = FixedStep() if fixed_step is None else fixed_step
        if not isinstance(world, World):
            raise OptionError(f"world must be a taichi_soft.World, got {type(world).__name__}")
        if not isinstance(fixed_step, FixedStep):
            raise OptionError(f"fixed_step must be a FixedStep, got {type(fixed_step).__name__}")
        if not (before_step is None or callable(before_step)):
            raise OptionError(f"before_step must be a function of the world, got {before_step!r}")
        if not world.is_built:
            raise StateError("the world is not built: call world.build() before EngineAdapter(world)")
        self._world = world
        self._handles = handles_of(world)
        self._fixed_step = fixed_step
        self._before_step = before_step
        self._accumulator = Accumulator(fixed_step)
        ticks = as_count(rewind_ticks, "rewind_ticks", 0)
        self._rollback = Rollback(world, ticks) if ticks else None
        if self._rollback is not None:
            self._rollback.save()
        self._rewind_ticks = ticks
        self._budget = None if budget_ms is None else Budget(world, budget_ms)
        self._dropped_time = 0.0
        self._total_dropped_time = 0.0

    @property
    def world(self) -> World:
        """World that the adapter steps."""
        return self._world

    @property
    def fixed_step(self) -> FixedStep:
        """Length of a step, its substeps, and the largest number of steps per frame."""
        return self._fixed_step

    @property
    def alpha(self) -> float:
        """Interpolation factor between the states before (0) and after (1) the last step; always below 1."""
        return self._accumulator.alpha

    @property
    def time(self) -> float:
        """Simulated time of the interpolated positions [s].

        This time is one step behind the sum of all frame times. Before the first step, `time` is the time of
        the world.
        """
        return self._world.time - (1.0 - self.alpha) * self._world.last_dt

    @property
    def dropped_time(self) -> float:
        """Time that the last `advance` dropped [s]; 0 if the machine is fast enough."""
        return self._dropped_time

    @property
    def total_dropped_time(self) -> float:
        """Time that all calls of `advance` have dropped [s]."""
        return self._total_dropped_time

    @one_thread
    def step(self) -> None:
        """Make exactly one fixed step, independent of frame times, for replays, tests and servers.

        Raises: errors of `before_step` and `World.step`. After an error in the step, only the changes of
            `before_step` remain.
        """
        if self._before_step is not None:
            self._before_step(self._world)
        if self._budget is None:
            self._world.step(self._fixed_step.dt, self._fixed_step.substeps)
        else:
            self._step_within(self._budget)
        if self._rollback is not None:
            self._rollback.save()

    def _step_within(self, budget: Budget) -> None:
        """Make a step with the levels and skipped bodies that `budget` chooses."""
        step = self._world.step_count
        try:
            budget.prepare(self._rewind_ticks)
            start = perf_counter()
            self._world.step(self._fixed_step.dt, self._fixed_step.substeps)
            budget.record(perf_counter() - start)
        except BaseException:
            if self._world.step_count == step:
                budget.revert()
            raise

    @one_thread
    def advance(self, frame_dt: float) -> int:
        """Add the time of one frame and make the steps that are due.

        Args:
            frame_dt: time since the last frame [s], 0 or more.
        Returns: number of steps made, at most `max_steps`. If more steps are due, all remaining time is
            dropped (see `dropped_time`).
        Raises: OptionError if `frame_dt` is negative or not finite, with nothing changed; errors of `step`.
            After an error of `step`, the time of the steps that were not made counts as dropped.
        """
        seconds = as_number(frame_dt, "frame_dt", 0.0, math.inf, "a number of 0 s or more")
        steps, dropped = self._accumulator.put(seconds)
        before = self._world.step_count
        made = 0
        try:
            for _ in range(steps):
                self.step()
        finally:
            made = self._world.step_count - before  # includes a step whose warning was raised as an error
            self._dropped_time = dropped + (steps - made) * self._fixed_step.dt
            self._total_dropped_time += self._dropped_time
        return made

    def see_from(self, viewer: ArrayLike) -> None:
        """Set the position of the camera. A budget reduces the detail of the farthest bodies first.

        Args:
            viewer: position of the camera, (3,) [m].
        Raises: OptionError for an invalid position; StateError without `budget_ms`.
        """
        self._required_budget.see_from(viewer)

    @property
    def budget_status(self) -> BudgetStatus:
        """Return the bodies with reduced detail or skipped steps, and whether steps fit the budget.

        Raises: StateError without `budget_ms`.
        """
        return self._required_budget.status

    @property
    def given_up(self) -> BudgetStatus:
        """Deprecated name of `budget_status`."""
        warn_renamed("EngineAdapter.given_up", "EngineAdapter.budget_status")
        return self.budget_status

    @property
    def _required_budget(self) -> Budget:
        if self._budget is None:
            raise StateError("this adapter has no budget: create it with budget_ms")
        return self._budget

    @one_thread
    def rewind(self, steps: int) -> None:
        """Undo the last `steps` steps and the inputs of these steps.

        The world returns to the state before the inputs of the first undone step. To repeat the steps, call
        `step` with the corrected inputs. `alpha` does not change, so that rendering resumes at the same
        simulated time after the repeated steps.
        Args:
            steps: number of fixed steps, from 1 to `rewind_ticks`.
        Raises: OptionError if `steps` exceeds `rewind_ticks` or the number of steps since the last `restore`;
            StateError without `rewind_ticks`.
        """
        if self._rollback is None:
            raise StateError("this adapter stores no steps: create it with rewind_ticks")
        back = as_count(steps, "steps")
        if back > self._world.step_count:
            raise OptionError(f"steps is {back}: the world has made {self._world.step_count}")
        self._rollback.rewind_to(self._world.step_count - back)

    def snapshot(self) -> bytes:
        """Return the state of the world, see `World.snapshot`. The snapshot does not contain `alpha`."""
        return self._world.snapshot()

    @one_thread
    def restore(self, data: bytes) -> None:
        """Restore a state, see `World.restore`. `alpha` becomes 0, and `rewind` cannot undo earlier steps.

        Args:
            data: result of `snapshot`, from this world or from another world that was built the same way.
        Raises: as `World.restore`, with nothing changed.
        """
        self._world.restore(data)
        self._accumulator.remainder = 0.0
        if self._budget is not None:
            self._budget.restart()
        if self._rollback is not None:
            self._rollback.save()

    def state_hash(self) -> str:
        """Return a hash of the state, see `World.state_hash`."""
        return self._world.state_hash()

    def drain_events(self) -> list[Event]:
        """Return the events of all fixed steps since the last call, see `World.drain_events`."""
        return self._world.drain_events()

    def positions(self, body: Body, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Read the positions of a body, interpolated between the states before and after the last step,
        float32 (n, 3) [m].

        Args:
            body: body of this adapter's world.
            out: C-contiguous float32 array to fill and return; None allocates a new one.
        Raises: OptionError if `out` has the wrong shape or type, or the body belongs to another world;
            StateError if the body was removed.
        """
        return self._world.read_positions(body, self._accumulator.alpha, out)

    def render_mesh(
        self,
        mesh: RenderMesh | Body,
        positions: NDArray[np.float32] | None = None,
        normals: NDArray[np.float32] | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Read positions [m] and normals of a render mesh, interpolated between the states before and after
        the last step, float32 (k, 3) each.

        Args:
            mesh: render mesh of a body of this adapter's world, see `Body.render_mesh`; or a body, for the
                first of its `render_meshes`.
            positions, normals: C-contiguous float32 arrays to fill and return; None allocates new ones.
        Raises: as `World.read_render_mesh`.
        """
        return self._world.read_render_mesh(mesh, self._accumulator.alpha, positions, normals)
