"""A budget of milliseconds for the steps of a world, kept by levels of detail."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft import Body, StateError, World
from taichi_soft.core.checks import as_positive, as_vector
from taichi_soft.core.handles import serial_of

TIGHT, FULL, ROOMY = 0.85, 0.75, 0.6
"""Of the budget: what a step is expected to take where levels are lowered, until it is expected to take FULL,
and what it may take at most after some were raised. Single steps take longer than the median, by a sixth or
so, and fit the budget, too. The gaps keep levels from going up and down for ever."""

REMEMBERED = 8
"""Steps of which the median says what a tetrahedron costs: one that was interrupted does not count."""

PATIENCE = 30
"""Steps without a change before levels are raised: half a second of a game."""

TRY_AGAIN = 8
"""Steps after which it is looked again where nothing could be given up: looking takes time, too."""

CHANGING = 0.5
"""Of the budget: what changes of level may take before one step. One is made in any case."""


@dataclass(frozen=True)
class GivenUp:
    """What a budget has cost in detail."""

    levels: dict[Body, int]  # of bodies that are coarser than they could be
    step_ms: float  # what a step takes, by the last ones
    is_met: bool  # False where all that can be given up is, and steps take longer still


class Budget:
    """Lowers the levels of the farthest bodies where steps take too long, and raises them again."""

    def __init__(self, world: World, milliseconds: float) -> None:
        """Raises: OptionError for a number that is not above 0."""
        self.seconds = 1e-3 * as_positive(milliseconds, "budget_ms", "ms")
        self._world = world
        self._viewer: NDArray[np.float64] | None = None
        self._costs: deque[float] = deque(maxlen=REMEMBERED)  # of a tetrahedron in a step [s]
        self._load = 0  # tetrahedra in the coming step, or the last one
        self._calm = 0  # steps since a level changed, or none could be raised
        self._waits = 0  # steps until it is looked again what could be lowered
        self._decided: dict[int, list[tuple[int, int]]] = {}  # handle and level, by step
        self._newest = -1  # step that was decided last

    def see_from(self, viewer: ArrayLike) -> None:
        """Where distances are measured from, (3,) [m]."""
        self._viewer = as_vector(viewer, "viewer", "m")

    @property
    def given_up(self) -> GivenUp:
        """As things are."""
        levels = {body: body.level for body in self._world.bodies if body.level}
        expected = self._expected(self._tets())
        return GivenUp(levels, 1e3 * expected, expected <= self.seconds)

    def note(self, seconds: float) -> None:
        """Take note of what the last step took [s]."""
        if self._load:
            self._costs.append(seconds / self._load)

    def prepare(self, ticks: int) -> None:
        """Choose levels for the coming step, and keep the choice for as long as `ticks` steps.

        A step that was made before and is made again, after `rewind`, gets the levels that it had then: the
        clock decides once.
        """
        step = self._world.step_count
        if step <= self._newest:
            self._repeat(self._decided.get(step, []))
            self._load = self._tets()
            return
        self._newest = step
        self._load = self._tets()
        changes = self._changes()
        self._calm = 0 if changes else self._calm + 1
        if changes:
            self._load = self._tets()
        if changes and ticks:
            self._decided[step] = [(serial_of(body), level) for body, level in changes]
        for old in [each for each in self._decided if each < step - ticks]:
            del self._decided[old]

    def restart(self) -> None:
        """The world was put to another state: what was decided belongs to another course of events."""
        self._decided.clear()
        self._newest, self._calm, self._waits = -1, 0, 0

    def _repeat(self, changes: list[tuple[int, int]]) -> None:
        bodies = {serial_of(body): body for body in self._world.bodies}
        for serial, level in changes:
            if serial in bodies:  # with other inputs something may hold it now
                _has_changed(bodies[serial], level)

    def _tets(self) -> int:
        """Tetrahedra that move, or may."""
        return sum(len(body.tets) for body in self._world.bodies)

    def _expected(self, load: float) -> float:
        """What a step takes with so many tetrahedra [s]."""
        return load * median(self._costs) if self._costs else 0.0

    def _changes(self) -> list[tuple[Body, int]]:
        """Make those that are due."""
        if self._expected(self._load) > TIGHT * self.seconds:
            return self._lowered(self._load)
        return self._raised(self._load) if self._calm >= PATIENCE else []

    def _lowered(self, load: float) -> list[tuple[Body, int]]:
        """The farthest first, by one level each, until a step is expected to fit. Sleepers cost nothing."""
        if self._waits:
            self._waits -= 1
            return []
        changes: list[tuple[Body, int]] = []
        start = perf_counter()
        for body in self._by_distance(self._with_levels(1), reverse=True):
            if self._expected(load) <= FULL * self.seconds or (changes and self._is_late(start)):
                break
            before = len(body.tets)
            if not body.is_asleep and _has_changed(body, body.level + 1):
                load -= before - len(body.tets)
                changes.append((body, body.level))
        self._waits = 0 if changes else TRY_AGAIN
        return changes

    def _raised(self, load: float) -> list[tuple[Body, int]]:
        """The nearest first, by one level each, as long as a step is expected to fit."""
        changes: list[tuple[Body, int]] = []
        start = perf_counter()
        for body in self._by_distance(self._with_levels(-1), reverse=False):
            finer = body.level - 1
            more = len(body.asset.levels[finer].mesh.tets) - len(body.tets)
            if self._expected(load + more) > ROOMY * self.seconds or (changes and self._is_late(start)):
                break
            if _has_changed(body, finer):
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

    def _by_distance(self, bodies: list[Body], *, reverse: bool) -> list[Body]:
        """From the nearest to the farthest; by slot where nobody looks."""
        if self._viewer is None:
            return bodies[::-1] if reverse else bodies
        apart = [float(np.linalg.norm(body.center_of_mass() - self._viewer)) for body in bodies]
        order = np.argsort(apart, kind="stable")
        return [bodies[i] for i in (order[::-1] if reverse else order)]


def _has_changed(body: Body, level: int) -> bool:
    """Change the level of a body, unless something holds it: see `Body.set_level`."""
    try:
        body.set_level(level)
    except StateError:
        return False
    return True
