"""Find the tetrahedra of watched bodies whose stress begins to exceed a threshold in a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.kernels.origins import enter_all, leave_all
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.constants import LANES
from taichi_soft.core.handles import serial_of
from taichi_soft.elements.kernels.stress import NO_LIMIT, read_stress
from taichi_soft.events.event_state import HandleLookup, WatchEntry
from taichi_soft.events.kinds import Event, StressExceeded, TearCandidates

RESET_FRACTION = 0.9
"""Fraction of a threshold below which a tetrahedron's stress must fall before the tetrahedron can be
reported again. Without this condition, a tetrahedron that vibrates about the threshold would be reported
in every other step."""

VON_MISES, PRINCIPAL, AXIS = 0, 1, slice(2, 5)
"""Columns of `read_stress`: von Mises stress, largest principal stress, and direction of the principal
stress."""


@dataclass(eq=False)
class _Watch:
    body: SoftBody
    threshold: float  # [Pa]
    is_above: NDArray[np.bool_]  # (m,) True for tetrahedra above the threshold, in kernel order

    def newly_above(self, stress: NDArray[np.float32]) -> NDArray[np.int64]:
        """Return the rows of the tetrahedra that have begun to exceed the threshold, and update `is_above`.

        Args: stress: (m,) [Pa].
        """
        above = stress > self.threshold
        new = np.flatnonzero(above & ~self.is_above)
        self.is_above &= stress >= RESET_FRACTION * self.threshold
        self.is_above |= above
        return new


class StressWatches:
    """Bodies of one world whose stress is checked after each step."""

    def __init__(self, state: BodyFields, program: Program, scene: Scene) -> None:
        """Start without watches."""
        self._state = state
        self._program = program
        self._scene = scene
        self._watches: dict[tuple[type[Event], SoftBody], _Watch] = {}
        self._ranges: dict[SoftBody, slice] = {}  # rows of each body's tetrahedra in `_read`
        self._blocks = np.zeros(0, dtype=np.int32)
        self._limits = np.zeros(0, dtype=np.float32)  # tensile limit of each block [Pa]
        self._read = np.zeros((0, 5), dtype=np.float32)

    def set(self, kind: type[Event], body: SoftBody, threshold: float | None) -> None:
        """Watch a body for events of `kind` above a threshold [Pa]; None stops the watch."""
        self._watches.pop((kind, body), None)
        if threshold is not None:
            self._watches[kind, body] = _Watch(body, threshold, self._none_above(body))
        self._arrange()
        if len(self._blocks):
            self._evaluate()  # compiles the kernel now instead of in the next step of the game

    def _none_above(self, body: SoftBody) -> NDArray[np.bool_]:
        return np.zeros(len(self._scene.bodies[body.index].tet_vertices), dtype=np.bool_)

    def renew(self, body: SoftBody) -> None:
        """Reset the watches of a body that lost tetrahedra.

        If tetrahedra are still above a threshold, the next step reports them again.
        """
        for (kind, watched), watch in list(self._watches.items()):
            if watched is body:
                self.set(kind, body, watch.threshold)

    @property
    def entries(self) -> list[WatchEntry]:
        """Watches of all bodies that are alive."""
        return [
            WatchEntry(kind, serial_of(body), watch.threshold, np.packbits(watch.is_above).tobytes())
            for (kind, body), watch in self._watches.items()
            if body.is_alive
        ]

    def restore(self, entries: list[WatchEntry], lookup: HandleLookup) -> None:
        """Restore the watches of an earlier state. Watches that were set later remain.

        If tetrahedra are above the threshold of a later watch, the next step reports them again.
        """
        if not entries and not self._watches:
            return
        for (_, body), watch in self._watches.items():
            watch.is_above = self._none_above(body)
        for entry in entries:
            watched = lookup.body(entry.serial)
            if watched is not None:
                bits = np.frombuffer(entry.is_above, dtype=np.uint8)
                is_above = np.unpackbits(bits, count=len(self._none_above(watched))).astype(np.bool_)
                self._watches[entry.kind, watched] = _Watch(watched, entry.threshold, is_above)
        self._arrange()

    def _arrange(self) -> None:
        bodies = sorted({body for _, body in self._watches}, key=lambda body: body.index)
        ranges = [self._scene.ranges[body.index].blocks for body in bodies]
        self._ranges, start = {}, 0
        for body, (first, last) in zip(bodies, ranges, strict=True):
            count = len(self._scene.bodies[body.index].tet_vertices)
            self._ranges[body] = slice(start, start + count)
            start += (last - first) * LANES
        rows = [np.arange(*span, dtype=np.int32) for span in ranges]
        self._blocks = np.concatenate([np.zeros(0, dtype=np.int32), *rows])
        tear_watches = [self._watches.get((TearCandidates, body)) for body in bodies]
        limits = [NO_LIMIT if watch is None else watch.threshold for watch in tear_watches]
        self._limits = np.repeat(limits, [len(blocks) for blocks in rows]).astype(np.float32)
        self._read = np.zeros((start, 5), dtype=np.float32)

    def _evaluate(self) -> None:
        count = len(self._scene.bodies)
        has_far_bodies = enter_all(self._state, count, 0)
        read_stress(self._state, self._program, self._blocks, self._limits, self._read)
        if has_far_bodies:
            leave_all(self._state, count)

    def warm_up(self) -> None:
        """Evaluate the stress of one block without recording events, so that the kernel is compiled."""
        enter_all(self._state, len(self._scene.bodies), 0)
        leave_all(self._state, len(self._scene.bodies))
        read_stress(
            *(self._state, self._program, np.zeros(1, np.int32), np.zeros(1, np.float32)),
            np.empty((LANES, 5), np.float32),
        )

    def events(self, kind: type[Event], step: int, time: float) -> Iterator[Event]:
        """Yield the events of one kind, body by body, from the stress that `update` evaluated.

        Args: step, time: index of the step; its end [s].
        """
        for body, span in self._ranges.items():
            watch = self._watches.get((kind, body))
            if watch is None:
                continue
            column = PRINCIPAL if kind is TearCandidates else VON_MISES
            rows = watch.newly_above(self._read[span, column])
            if not len(rows):
                continue
            names = self._scene.bodies[body.index].tet_order[rows].astype(np.int64)
            order = np.argsort(names)
            values = self._read[span][rows[order]].astype(np.float64)
            if kind is TearCandidates:
                yield TearCandidates(step, time, body, names[order], values[:, PRINCIPAL], values[:, AXIS])
            else:
                yield StressExceeded(step, time, body, names[order], values[:, VON_MISES])

    def update(self) -> None:
        """Evaluate the stress of all watched bodies that are alive."""
        removed = [key for key in self._watches if not key[1].is_alive]
        for key in removed:
            del self._watches[key]
        if removed:
            self._arrange()
        if len(self._blocks):
            self._evaluate()
