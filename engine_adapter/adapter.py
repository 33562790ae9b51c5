"""A world inside a game loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter.budget import Budget, GivenUp
from engine_adapter.fixed_step import Accumulator, FixedStep
from engine_adapter.rollback import Rollback
from taichi_soft import Body, Event, OptionError, RenderMesh, StateError, World
from taichi_soft.core.checks import as_count, as_number
from taichi_soft.core.handles import handles_of
from taichi_soft.core.threads import one_thread


class EngineAdapter:
    """Runs a built world in fixed steps, whatever the frame rate, and gives the positions to draw.

    While an adapter is in use, only the adapter steps and restores its world: `alpha` and `time` count its
    steps. As a world, it takes calls of one thread at a time.

        adapter = EngineAdapter(world, FixedStep(dt=1 / 60))
        while running:
            adapter.advance(seconds_since_last_frame)
            adapter.positions(body, out=vertex_buffer)

    Args:
        world: built.
        fixed_step: length of a step, its substeps, and how many one frame may make.
        before_step: called with the world before every fixed step: the place to move colliders and frames,
            to push and to grab, so that it happens at the same moments whatever the frame rate.
        rewind_ticks: steps that `rewind` can go back; 0 keeps nothing.
        budget_ms: what a fixed step may take [ms], with changes before it. Where it takes longer, bodies with
            levels of detail get coarser, the farthest first (see `see_from`), and the farthest skip steps
            where that is not enough. They get all back when there is time. See `given_up`. None: all stay as
            they are.
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
        """The world that is stepped."""
        return self._world

    @property
    def fixed_step(self) -> FixedStep:
        """How time is cut into steps."""
        return self._fixed_step

    @property
    def alpha(self) -> float:
        """How far the picture is from the previous step to the last one, at least 0 and below 1."""
        return self._accumulator.alpha

    @property
    def time(self) -> float:
        """Simulated time of the interpolated positions [s]: `alpha` of the way through the last step.

        It is one step behind all the time put in. Before the first step it is the world's time.
        """
        return self._world.time - (1.0 - self.alpha) * self._world.last_dt

    @property
    def dropped_time(self) -> float:
        """Time that the last `advance` dropped [s], 0 where the machine keeps up."""
        return self._dropped_time

    @property
    def total_dropped_time(self) -> float:
        """Time dropped so far [s]."""
        return self._total_dropped_time

    @one_thread
    def step(self) -> None:
        """Make exactly one fixed step, past the accumulator: for replays, tests and servers.

        Raises: what `before_step` and `World.step` raise. If the step was not made, nothing has changed but
            what `before_step` itself has done.
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
        """Make a step for which a budget chooses what is given up."""
        step = self._world.step_count
        try:
            budget.prepare(self._rewind_ticks)
            start = perf_counter()
            self._world.step(self._fixed_step.dt, self._fixed_step.substeps)
            budget.note(perf_counter() - start)
        except BaseException:
            if self._world.step_count == step:
                budget.take_back()
            raise

    @one_thread
    def advance(self, frame_dt: float) -> int:
        """Put in the time of one frame and make the steps that are due.

        Args:
            frame_dt: time since the last frame [s], 0 or more.
        Returns: how many steps were made, at most `max_steps`. Time for more is dropped, the part of a step
            included (see `dropped_time`).
        Raises: OptionError for a frame_dt that is negative or not finite, with nothing changed; what
            `step` raises: the steps not made then count as dropped.
        """
        seconds = as_number(frame_dt, "frame_dt", 0.0, math.inf, "a number of 0 s or more")
        steps, dropped = self._accumulator.put(seconds)
        before = self._world.step_count
        made = 0
        try:
            for _ in range(steps):
                self.step()
        finally:
            made = self._world.step_count - before  # also a step whose warning was raised
            self._dropped_time = dropped + (steps - made) * self._fixed_step.dt
            self._total_dropped_time += self._dropped_time
        return made

    def see_from(self, viewer: ArrayLike) -> None:
        """Say where the camera is, (3,) [m]: a budget takes from the farthest bodies first.

        Args:
            viewer: place of the camera, (3,) [m].
        Raises: OptionError for what is no place; StateError without `budget_ms`.
        """
        self._required_budget.see_from(viewer)

    @property
    def given_up(self) -> GivenUp:
        """Which bodies are coarser than they could be, which skip steps, and whether the budget is met.

        Raises: StateError without `budget_ms`.
        """
        return self._required_budget.given_up

    @property
    def _required_budget(self) -> Budget:
        if self._budget is None:
            raise StateError("this adapter has no budget: make it with budget_ms")
        return self._budget

    @one_thread
    def rewind(self, steps: int) -> None:
        """Go back by that many steps, to where the world was before the inputs of the first of them.

        `alpha` stays: make the steps again by `step`, with the inputs as they should have been, and the
        picture goes on where it was.
        Args:
            steps: number of fixed steps, from 1 to `rewind_ticks`.
        Raises: OptionError for more steps than `rewind_ticks`, or than were made since the last `restore`;
            StateError where nothing is kept.
        """
        if self._rollback is None:
            raise StateError("this adapter keeps no steps: make it with rewind_ticks")
        back = as_count(steps, "steps")
        if back > self._world.step_count:
            raise OptionError(f"steps is {back}: the world has made {self._world.step_count}")
        self._rollback.rewind_to(self._world.step_count - back)

    def snapshot(self) -> bytes:
        """See `World.snapshot`. The part of a step that `alpha` says is not in it."""
        return self._world.snapshot()

    @one_thread
    def restore(self, data: bytes) -> None:
        """Load a state: as `World.restore`, with `alpha` 0, and `rewind` as far as to here.

        Args:
            data: made by `snapshot`, of this world or one that was built of the same things.
        Raises: as `World.restore`, with nothing changed.
        """
        self._world.restore(data)
        self._accumulator.remainder = 0.0
        if self._budget is not None:
            self._budget.restart()
        if self._rollback is not None:
            self._rollback.save()

    def state_hash(self) -> str:
        """See `World.state_hash`."""
        return self._world.state_hash()

    def drain_events(self) -> list[Event]:
        """What happened in all fixed steps since the last call: see `World.drain_events`."""
        return self._world.drain_events()

    def positions(self, body: Body, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Positions of a body to draw, between the previous step and the last one, float32 (n, 3) [m].

        Args:
            body: of this adapter's world.
            out: C-contiguous float32 array to fill and return; None makes a new one.
        Raises: OptionError if `out` does not fit or the body belongs to another world; StateError if it was
            removed.
        """
        return self._world.read_positions(body, self._accumulator.alpha, out)

    def render_mesh(
        self,
        mesh: RenderMesh | Body,
        positions: NDArray[np.float32] | None = None,
        normals: NDArray[np.float32] | None = None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Positions [m] and normals to draw, between the previous step and the last one, float32 (k, 3) each.

        Args:
            mesh: of a body of this adapter's world, see `Body.render_mesh`; a body stands for the first of
                its `render_meshes`.
            positions, normals: C-contiguous float32 arrays to fill and return; None makes a new one.
        Raises: as `World.read_render_mesh`.
        """
        return self._world.read_render_mesh(mesh, self._accumulator.alpha, positions, normals)
