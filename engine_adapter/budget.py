"""Keep the steps of a world within a time budget, by lowering levels of detail and skipping steps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine_adapter.skips import Skips
from taichi_soft import Body, StateError, World
from taichi_soft.core.checks import as_positive, as_vector
from taichi_soft.core.handles import keep, serial_of, undo

TIGHT, FULL, ROOMY = 0.98, 0.86, 0.7
"""Limits of the expected time of a long step, as fractions of the budget. If the time is above TIGHT, detail
is reduced until the time is at most FULL. Detail is raised only while the time stays at most ROOMY. The
differences between the limits prevent levels from oscillating."""

REMEMBERED = 8
"""Number of recent steps from which the cost of a tetrahedron is computed. The cost is a median, so that
single interrupted steps have no effect."""

SPREAD, LONG, LEAST_LONG, MOST_LONG = 240, 0.97, 1.15, 1.5
"""A long step is expected to take the median step time multiplied by a factor. SPREAD: number of recent steps
whose ratios of time to median are stored. LONG: quantile of these ratios that is used as the factor.
LEAST_LONG, MOST_LONG: limits of the factor. Without MOST_LONG, detail would be reduced too far if other
programs interrupted many steps."""

PATIENCE = 30
"""Number of steps without a reduction of detail before levels are raised. This is 0.5 s at 60 steps per
second."""

TRY_AGAIN = 8
"""Number of steps until the next search for levels to lower, if a search found none. Each search takes
time."""

CHANGING = 0.25
"""Time for changes of level before a step, as a fraction of the budget. When this time is over, no further
level is changed. The first change is always made."""


@dataclass(frozen=True)
class BudgetStatus:
    """Detail that a time budget has reduced. Returned by `EngineAdapter.budget_status`."""

    levels: dict[Body, int]  # levels of the bodies that are not at their finest level
    skipping: tuple[Body, ...]  # bodies that skip steps, the farthest first, see `World.skip_step`
    step_ms: float  # expected time of a step, from recent steps [ms]
    is_met: bool  # False if steps exceed the budget although all detail is reduced


@dataclass
class _Decision:
    """Decision for one step: levels to set, and bodies that skip the step, by handle number."""

    levels: list[tuple[int, int]]
    skipping: list[int]


class Budget:
    """Keeps steps within a time budget.

    If steps take too long, the budget lowers the levels of the farthest bodies. If that is not enough or
    takes effect too late, the farthest bodies skip steps. If steps take less time again, the budget undoes
    these changes in reverse order."""

    def __init__(self, world: World, milliseconds: float) -> None:
        """Set the budget [ms]. Raises: OptionError for a number that is not above 0."""
        self.seconds = 1e-3 * as_positive(milliseconds, "budget_ms", "ms")
        self._world = world
        self._viewer: NDArray[np.float64] | None = None
        self._costs: deque[float] = deque(maxlen=REMEMBERED)  # cost of a tetrahedron in recent steps [s]
        self._spread: deque[float] = deque(maxlen=SPREAD)  # each cost, divided by the median of earlier costs
        self._load = 0  # number of tetrahedra that move in the next step, or moved in the last step
        self._calm = 0  # steps since a reduction or an attempt to raise levels
        self._waits = 0  # steps until the next attempt to lower levels
        self._skips = Skips(world, self._from_near)
        self._decided: dict[int, _Decision] = {}  # decisions, by step count
        self._newest = -1  # newest step with a decision
        self._before: bytes | None = None  # state before the current decision, which `revert` restores

    def see_from(self, viewer: ArrayLike) -> None:
        """Set the point from which distances are measured, (3,) [m]."""
        self._viewer = as_vector(viewer, "viewer", "m")

    @property
    def status(self) -> BudgetStatus:
        """Return the current status."""
        levels = {body: body.level for body in self._world.bodies if body.level}
        skipping = tuple(body for body in self._skips.slow if body.is_alive)
        expected = self._expected(self._load if skipping else self._tets())
        return BudgetStatus(levels, skipping, 1e3 * expected, expected <= self.seconds)

    def record(self, seconds: float) -> None:
        """Record the time of the last step [s]."""
        if self._load:
            cost = seconds / self._load
            usual = median(self._costs) if len(self._costs) == REMEMBERED else 0.0
            if usual > 0.0:
                self._spread.append(cost / usual)
            self._costs.append(cost)

    def prepare(self, ticks: int) -> None:
        """Choose levels and skipped bodies for the next step, and store the decision for `ticks` steps.

        A step that is repeated after `rewind` gets the same decision again, so that the result does not
        depend on the clock.
        """
        step, self._before = self._world.step_count, None
        if step <= self._newest:
            self._repeat(self._decided.get(step))
            return
        self._newest = step
        start = perf_counter()
        changes = self._changes(self._tets(), start)
        skipping = self._skip(self._tets(), perf_counter() - start if changes else 0.0)
        self._calm = 0 if changes or self._skips.slow else self._calm + 1
        if ticks and (changes or skipping):
            levels = [(serial_of(body), level) for body, level in changes]
            self._decided[step] = _Decision(levels, [serial_of(body) for body in skipping])
        for old in [each for each in self._decided if each < step - ticks]:
            del self._decided[old]

    def revert(self) -> None:
        """Undo the changes of the last `prepare`, because the step after it failed."""
        if self._before is not None:
            undo(self._world, self._before)
        step = self._world.step_count
        if step == self._newest:
            self._newest -= 1
            self._decided.pop(step, None)

    def _keep(self) -> None:
        """Store the state before a change, so that `revert` can restore it."""
        if self._before is None:
            self._before = keep(self._world)

    def restart(self) -> None:
        """Discard all decisions, because the world was restored to another state."""
        self._decided.clear()
        self._skips.restart()
        self._newest, self._calm, self._waits = -1, 0, 0

    def _repeat(self, decision: _Decision | None) -> None:
        bodies = {serial_of(body): body for body in self._world.bodies}
        skipping: list[Body] = []
        if decision is not None:
            for serial, level in decision.levels:
                if serial in bodies:  # other inputs may have removed the body
                    self._has_changed(bodies[serial], level)
            skipping = [bodies[serial] for serial in decision.skipping if serial in bodies]
        self._let_skip(skipping)

    def _let_skip(self, skipping: list[Body]) -> None:
        if skipping:
            self._keep()
            self._world.skip_step(skipping)
        self._load = self._tets() - sum(len(body.tets) for body in skipping)

    def _tets(self) -> int:
        """Return the number of tetrahedra of all bodies."""
        return sum(len(body.tets) for body in self._world.bodies)

    def _expected(self, load: float) -> float:
        """Return the expected time of a step with `load` tetrahedra [s]."""
        return load * median(self._costs) if self._costs else 0.0

    def _long(self, load: float) -> float:
        """Return the expected time of a long step with `load` tetrahedra [s]."""
        longer = LEAST_LONG
        if len(self._spread) >= PATIENCE:
            longer = sorted(self._spread)[int(LONG * len(self._spread))]
        return self._expected(load) * min(max(longer, LEAST_LONG), MOST_LONG)

    def _skip(self, load: int, spent: float) -> list[Body]:
        """Choose the bodies that skip the next step. `spent` is the time of the changes before it [s]."""
        left = self.seconds - min(spent, 2 * CHANGING * self.seconds)
        long = self._long(load)
        is_full = long > (FULL if self._skips.slow else TIGHT) * left
        skipping = self._skips.choose(load, FULL * left / long * load if is_full else load)
        self._let_skip(skipping)
        return skipping

    def _changes(self, load: int, start: float) -> list[tuple[Body, int]]:
        """Raise or lower levels if necessary, and return the changed bodies with their new levels."""
        if self._long(load) > (FULL if self._skips.slow else TIGHT) * self.seconds:
            return self._lowered(load, start)
        return self._raised(load, start) if self._calm >= PATIENCE else []

    def _lowered(self, load: float, start: float) -> list[tuple[Body, int]]:
        """Lower the farthest bodies first, by one level each, until a step is expected to fit the budget.

        Sleeping bodies are not lowered, because they take no time.
        """
        if self._waits:
            self._waits -= 1
            return []
        changes: list[tuple[Body, int]] = []
        for body in reversed(self._from_near(self._with_levels(1))):
            if self._long(load) <= FULL * self.seconds or (changes and self._is_late(start)):
                break
            before = len(body.tets)
            if not body.is_asleep and self._has_changed(body, body.level + 1):
                load -= before - len(body.tets)
                changes.append((body, body.level))
        self._waits = 0 if changes else TRY_AGAIN
        return changes

    def _raised(self, load: float, start: float) -> list[tuple[Body, int]]:
        """Raise the nearest bodies first, by one level each, while a step is expected to fit the budget."""
        changes: list[tuple[Body, int]] = []
        for body in self._from_near(self._with_levels(-1)):
            finer = body.level - 1
            more = len(body.asset.levels[finer].mesh.tets) - len(body.tets)
            if self._long(load + more) > ROOMY * self.seconds or (changes and self._is_late(start)):
                break
            if self._has_changed(body, finer):
                load += more
                changes.append((body, finer))
        self._calm = 0
        return changes

    def _is_late(self, start: float) -> bool:
        """True if the time for changes of level, which began at `start`, is over, see `CHANGING`."""
        return perf_counter() - start > CHANGING * self.seconds

    def _with_levels(self, change: int) -> list[Body]:
        """Return the bodies whose level can change by `change` (1 or -1), by slot."""
        return [body for body in self._world.bodies if 0 <= body.level + change < len(body.asset.levels)]

    def _from_near(self, bodies: list[Body]) -> list[Body]:
        """Return bodies sorted from the nearest to the farthest; without a viewer, sorted by slot."""
        if self._viewer is None:
            return sorted(bodies, key=lambda body: body.index)
        apart = [float(np.linalg.norm(body.center_of_mass() - self._viewer)) for body in bodies]
        return [bodies[i] for i in np.argsort(apart, kind="stable")]

    def _has_changed(self, body: Body, level: int) -> bool:
        """Change the level of a body. Return False if the change is refused, see `Body.set_level`.

        The level of a held body is not lowered, because a player can be dragging the body.
        """
        if body.is_held and level > body.level:
            return False
        self._keep()
        try:
            body.set_level(level)
        except StateError:
            return False
        return True
