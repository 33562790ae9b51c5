"""Which bodies stand still in a step, where there is no time for all: the farthest, in turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from taichi_soft import Body, World
from taichi_soft.core.handles import serial_of

LEAST = 0.25
"""Of the tetrahedra that skip steps, what moves in each: nobody skips more than three steps in a row."""

LOOK_AGAIN = 8
"""Steps after which it is looked again who touches whom, and who is how far away."""


@dataclass(frozen=True)
class _Island:
    """Bodies that move together or not at all."""

    bodies: tuple[Body, ...]
    tets: int


class Skips:
    """Chooses islands that skip a step: half of the steps of the farthest, and more where that is not enough.

    The nearest island never skips, nor does one of which something holds a body: see `Body.is_held`.
    """

    def __init__(self, world: World, from_near: Callable[[list[Body]], list[Body]]) -> None:
        """Args: from_near: puts bodies in the order of their distances."""
        self.slow: tuple[Body, ...] = ()  # bodies that skip steps now, the farthest first
        self._world, self._from_near = world, from_near
        self._islands: list[_Island] = []  # that may skip, the farthest first
        self._looked = 0  # steps until it is looked again
        self._waited: dict[int, int] = {}  # steps that a body has skipped in a row, by its handle

    def restart(self) -> None:
        """Nobody skips."""
        self.slow, self._looked = (), 0
        self._waited.clear()

    def choose(self, load: int, limit: float) -> list[Body]:
        """Bodies that are to stand still, so that of `load` tetrahedra about `limit` move in a step."""
        if load <= limit:
            self.restart()
            return []
        self._look()
        slow = self._slowed(load, limit)
        total, moving = sum(each.tets for each in slow), 0
        skipping: list[Body] = []
        # Who has waited longest goes first, and of those who waited as long the nearest.
        for island in sorted(reversed(slow), key=self._wait, reverse=True):
            if moving < LEAST * total or load - total + moving + island.tets <= limit:
                moving += island.tets
                self._waited.update((serial_of(body), 0) for body in island.bodies)
            else:
                skipping += island.bodies
                self._waited.update((serial_of(body), self._wait(island) + 1) for body in island.bodies)
        self.slow = tuple(body for island in slow for body in island.bodies)
        return skipping

    def _look(self) -> None:
        """Find out who touches whom."""
        self._looked -= 1
        if self._looked >= 0 and all(body.is_alive for island in self._islands for body in island.bodies):
            return
        self._looked = LOOK_AGAIN
        island_of = {body: bodies for bodies in self._world.islands for body in bodies}
        from_near = list(dict.fromkeys(island_of[body] for body in self._from_near(list(island_of))))
        self._islands = [
            _Island(bodies, sum(len(body.tets) for body in bodies))
            for bodies in from_near[:0:-1]
            if not any(body.is_held or body.is_asleep for body in bodies)
        ]

    def _slowed(self, load: int, limit: float) -> list[_Island]:
        """The farthest, as many as it takes where each makes half of the steps."""
        slow, mean = [], float(load)
        for island in self._islands:
            if mean <= limit:
                break
            slow.append(island)
            mean -= 0.5 * island.tets
        return slow

    def _wait(self, island: _Island) -> int:
        return max(self._waited.get(serial_of(body), 0) for body in island.bodies)
