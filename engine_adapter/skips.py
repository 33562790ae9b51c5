"""Choose the bodies that skip a step if there is no time for all bodies. The farthest bodies take turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from taichi_soft import Body, World
from taichi_soft.core.handles import serial_of

LEAST = 0.25
"""Smallest fraction of the tetrahedra in slow islands that moves in each step. Slow islands are the islands
that currently skip steps. With this fraction, no body skips more than three steps in a row."""

LOOK_AGAIN = 8
"""Number of steps between updates of islands and distances."""


@dataclass(frozen=True)
class _Island:
    """A group of connected bodies. All bodies of a group skip the same steps."""

    bodies: tuple[Body, ...]
    tets: int


class Skips:
    """Chooses the islands that skip a step.

    The farthest islands skip half of their steps, or more if that is not enough. The nearest island and
    islands with a held body never skip, see `Body.is_held`.
    """

    def __init__(self, world: World, from_near: Callable[[list[Body]], list[Body]]) -> None:
        """Start without skipping.

        Args: from_near: function that sorts bodies by distance, nearest first.
        """
        self.slow: tuple[Body, ...] = ()  # bodies that currently skip steps, the farthest first
        self._world, self._from_near = world, from_near
        self._islands: list[_Island] = []  # islands that can skip, the farthest first
        self._looked = 0  # steps until the next update of islands
        self._waited: dict[int, int] = {}  # steps skipped in a row, by handle number

    def restart(self) -> None:
        """Stop all skipping."""
        self.slow, self._looked = (), 0
        self._waited.clear()

    def choose(self, load: int, limit: float) -> list[Body]:
        """Choose the bodies that skip the next step, so that only about `limit` of `load` tetrahedra move."""
        if load <= limit:
            self.restart()
            return []
        self._look()
        slow = self._slowed(load, limit)
        total, moving = sum(each.tets for each in slow), 0
        skipping: list[Body] = []
        # Islands that have waited longest move first. Islands that waited equally long move nearest first.
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
        """Update the list of islands and their order."""
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
        """Return the farthest islands that must skip every second step to keep the load within `limit`."""
        slow, mean = [], float(load)
        for island in self._islands:
            if mean <= limit:
                break
            slow.append(island)
            mean -= 0.5 * island.tets
        return slow

    def _wait(self, island: _Island) -> int:
        return max(self._waited.get(serial_of(body), 0) for body in island.bodies)
