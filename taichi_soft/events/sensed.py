"""Find the bodies that enter and leave sensors, after each step."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.contact.collider import Collider
from taichi_soft.core.handles import serial_of
from taichi_soft.events.event_state import HandleLookup
from taichi_soft.events.kinds import Entered, Left

Pair = tuple[int, int]
"""Slot of a body, and index of a sensor."""

Handles = tuple[SoftBody, Collider]


@dataclass
class Sensed:
    """Bodies in sensors after the last step."""

    _inside: dict[Pair, Handles] = field(default_factory=dict)

    def update(
        self, pairs: Iterable[Pair], handles: Callable[[Pair], Handles], step: int, time: float
    ) -> tuple[list[Entered], list[Left]]:
        """Replace the bodies in sensors by `pairs`, after the step that ended at `time` [s].

        Returns: the events of the bodies that entered, and of those that left, each sorted by body and
            sensor.
        Args: handles: returns the two handles of a pair.
        """
        now = {pair: handles(pair) for pair in sorted(pairs)}
        before, self._inside = self._inside, now
        entered = [Entered(step, time, *who) for pair, who in now.items() if before.get(pair) != who]
        left = [Left(step, time, *who) for pair, who in before.items() if now.get(pair) != who]
        return entered, left

    @property
    def rows(self) -> NDArray[np.int64]:
        """All pairs with the serial numbers of their handles, as rows of `EventState.inside`."""
        rows = [(*pair, serial_of(body), serial_of(sensor)) for pair, (body, sensor) in self._inside.items()]
        return np.array(rows, dtype=np.int64).reshape(-1, 4)

    def restore(self, rows: NDArray[np.int64], lookup: HandleLookup) -> None:
        """Continue with the pairs of an earlier state, except those of objects that no longer exist."""
        inside: dict[Pair, Handles] = {}
        for slot, index, serial, other in rows.tolist():
            body, sensor = lookup.body(serial), lookup.collider(other)
            if body is not None and sensor is not None and (body.index, sensor.index) == (slot, index):
                inside[slot, index] = body, sensor
        self._inside = inside
