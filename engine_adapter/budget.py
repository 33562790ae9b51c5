"""A budget of milliseconds for the steps of a world: kept by levels of detail, and by skipped steps."""

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
"""Of the budget: what a long step is expected to take where something is given up, until it is expected to
take FULL, and what it may take at most after levels were raised. The gaps keep levels from going up and down
for ever."""

REMEMBERED = 8
"""Steps of which the median says what a tetrahedron costs: one that was interrupted does not count."""

SPREAD, LONG, LEAST_LONG, MOST_LONG = 240, 0.97, 1.15, 1.5
"""A long step: of so many it is longer than this part, over the median; between these limits. Where other
programs interrupt steps all the time, more is given up, and no more than for half as long again."""

PATIENCE = 30
"""Steps in which nothing was given up before levels are raised: half a second of a game."""

TRY_AGAIN = 8
"""Steps after which it is looked again where no level could be lowered: looking takes time, too."""

CHANGING = 0.25
"""Of the budget: what changes of level may take before one step. One is made in any case."""


@dataclass(frozen=True)
class GivenUp:
    """What a budget has cost in detail."""

    levels: dict[Body, int]  # of bodies that are coarser than they could be
    skipping: tuple[Body, ...]  # bodies that skip steps, the farthest first: see `World.skip_step`
    step_ms: float  # what a step takes, by the last ones
    is_met: bool  # False where all that can be given up is, and steps take longer still


@dataclass
class _Decision:
    """Of one step, by handles."""

    levels: list[tuple[int, int]]
    skipping: list[int]


class Budget:
    """Lowers the levels of the farthest bodies where steps take too long, lets the farthest skip steps where
    that is not enough, or not yet, and gives back in the other order."""

    def __init__(self, world: World, milliseconds: float) -> None:
        """Raises: OptionError for a number that is not above 0."""
        self.seconds = 1e-3 * as_positive(milliseconds, "budget_ms", "ms")
        self._world = world
        self._viewer: NDArray[np.float64] | None = None
        self._costs: deque[float] = deque(maxlen=REMEMBERED)  # of a tetrahedron in a step [s]
        self._spread: deque[float] = deque(maxlen=SPREAD)  # the same, over the median before
        self._load = 0  # tetrahedra that move in the coming step, or moved in the last one
        self._calm = 0  # steps since something was given up, or levels could not be raised
        self._waits = 0  # steps until it is looked again what could be lowered
        self._skips = Skips(world, self._from_near)
        self._decided: dict[int, _Decision] = {}  # by step
        self._newest = -1  # step that was decided last
        self._before: bytes | None = None  # the world before the present choice, where it may be taken back

    def see_from(self, viewer: ArrayLike) -> None:
        """Where distances are measured from, (3,) [m]."""
        self._viewer = as_vector(viewer, "viewer", "m")

    @property
    def given_up(self) -> GivenUp:
        """As things are."""
        levels = {body: body.level for body in self._world.bodies if body.level}
        skipping = tuple(body for body in self._skips.slow if body.is_alive)
        expected = self._expected(self._load if skipping else self._tets())
        return GivenUp(levels, skipping, 1e3 * expected, expected <= self.seconds)

    def note(self, seconds: float) -> None:
        """Take note of what the last step took [s]."""
        if self._load:
            cost = seconds / self._load
            usual = median(self._costs) if len(self._costs) == REMEMBERED else 0.0
            if usual > 0.0:
                self._spread.append(cost / usual)
            self._costs.append(cost)

    def prepare(self, ticks: int) -> None:
        """Choose levels for the coming step and who skips it; keep the choice for as long as `ticks` steps.

        A step that was made before and is made again, after `rewind`, gets the levels that it had then: the
        clock decides once.
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

    def take_back(self) -> None:
        """Undo what the last `prepare` changed: its step was refused, and is chosen for anew."""
        if self._before is not None:
            undo(self._world, self._before)
        step = self._world.step_count
        if step == self._newest:
            self._newest -= 1
            self._decided.pop(step, None)

    def _keep(self) -> None:
        """Before a change: keep the world as it is, where the coming step may be refused."""
        if self._before is None:
            self._before = keep(self._world)

    def restart(self) -> None:
        """The world was put to another state: what was decided belongs to another course of events."""
        self._decided.clear()
        self._skips.restart()
        self._newest, self._calm, self._waits = -1, 0, 0

    def _repeat(self, decision: _Decision | None) -> None:
        bodies = {serial_of(body): body for body in self._world.bodies}
        skipping: list[Body] = []
        if decision is not None:
            for serial, level in decision.levels:
                if serial in bodies:  # with other inputs something may hold it now
                    self._has_changed(bodies[serial], level)
            skipping = [bodies[serial] for serial in decision.skipping if serial in bodies]
        self._let_skip(skipping)

    def _let_skip(self, skipping: list[Body]) -> None:
        if skipping:
            self._keep()
            self._world.skip_step(skipping)
        self._load = self._tets() - sum(len(body.tets) for body in skipping)

    def _tets(self) -> int:
        """Tetrahedra of all bodies."""
        return sum(len(body.tets) for body in self._world.bodies)

    def _expected(self, load: float) -> float:
        """What a step takes with so many tetrahedra [s]."""
        return load * median(self._costs) if self._costs else 0.0

    def _long(self, load: float) -> float:
        """What a long step takes with so many tetrahedra [s]."""
        longer = LEAST_LONG
        if len(self._spread) >= PATIENCE:
            longer = sorted(self._spread)[int(LONG * len(self._spread))]
        return self._expected(load) * min(max(longer, LEAST_LONG), MOST_LONG)

    def _skip(self, load: int, spent: float) -> list[Body]:
        """Let bodies skip the coming step, where changes have taken so long before it [s]."""
        left = self.seconds - min(spent, 2 * CHANGING * self.seconds)
        long = self._long(load)
        is_full = long > (FULL if self._skips.slow else TIGHT) * left
        skipping = self._skips.choose(load, FULL * left / long * load if is_full else load)
        self._let_skip(skipping)
        return skipping

    def _changes(self, load: int, start: float) -> list[tuple[Body, int]]:
        """Make those that are due."""
        if self._long(load) > (FULL if self._skips.slow else TIGHT) * self.seconds:
            return self._lowered(load, start)
        return self._raised(load, start) if self._calm >= PATIENCE else []

    def _lowered(self, load: float, start: float) -> list[tuple[Body, int]]:
        """The farthest first, by one level each, until a step is expected to fit. Sleepers cost nothing."""
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
        """The nearest first, by one level each, as long as a step is expected to fit."""
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
        """Whether changes since a moment take too long for one frame."""
        return perf_counter() - start > CHANGING * self.seconds

    def _with_levels(self, change: int) -> list[Body]:
        """Bodies whose level may change by 1 or -1, by slot."""
        return [body for body in self._world.bodies if 0 <= body.level + change < len(body.asset.levels)]

    def _from_near(self, bodies: list[Body]) -> list[Body]:
        """From the nearest to the farthest; by slot where nobody looks."""
        if self._viewer is None:
            return sorted(bodies, key=lambda body: body.index)
        apart = [float(np.linalg.norm(body.center_of_mass() - self._viewer)) for body in bodies]
        return [bodies[i] for i in np.argsort(apart, kind="stable")]

    def _has_changed(self, body: Body, level: int) -> bool:
        """Change the level of a body, unless something bars it: see `Body.set_level`.

        What is held gets no coarser: a player may have it in hand.
        """
        if body.is_held and level > body.level:
            return False
        self._keep()
        try:
            body.set_level(level)
        except StateError:
            return False
        return True
