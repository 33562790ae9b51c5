"""Watched bodies: which tetrahedra come over a stress in a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.fields import BodyFields
from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.constants import LANES
from taichi_soft.core.handles import serial_of
from taichi_soft.elements.kernels.stress import NO_LIMIT, read_stress
from taichi_soft.events.event_state import Known, WatchNote
from taichi_soft.events.kinds import Event, StressExceeded, TearCandidates

BACK_BELOW = 0.9
"""Part of a threshold below which a tetrahedron has to come before it can come over it again: or one that
vibrates about it would do so in every other step."""

VON_MISES, PRINCIPAL, AXIS = 0, 1, slice(2, 5)
"""Columns of `read_stress`."""


@dataclass(eq=False)
class _Watch:
    body: SoftBody
    threshold: float  # [Pa]
    is_over: NDArray[np.bool_]  # (m,) in kernel order

    def newly_over(self, stress: NDArray[np.float32]) -> NDArray[np.int64]:
        """Rows of those that have come over the threshold, given the stress of all (m,) [Pa]."""
        over = stress > self.threshold
        fresh = np.flatnonzero(over & ~self.is_over)
        self.is_over &= stress >= BACK_BELOW * self.threshold
        self.is_over |= over
        return fresh


class StressWatches:
    """The bodies of one world whose stress is looked at after each step."""

    def __init__(self, state: BodyFields, program: Program, scene: Scene) -> None:
        """Nothing is watched yet."""
        self._state = state
        self._program = program
        self._scene = scene
        self._watches: dict[tuple[type[Event], SoftBody], _Watch] = {}
        self._places: dict[SoftBody, slice] = {}  # of each one's tetrahedra in what is read
        self._blocks = np.zeros(0, dtype=np.int32)
        self._limits = np.zeros(0, dtype=np.float32)  # of each block, for tears [Pa]
        self._read = np.zeros((0, 5), dtype=np.float32)

    def set(self, kind: type[Event], body: SoftBody, threshold: float | None) -> None:
        """Watch a body for a kind of event from a stress [Pa] on; None for no longer."""
        self._watches.pop((kind, body), None)
        if threshold is not None:
            self._watches[kind, body] = _Watch(body, threshold, self._none_over(body))
        self._arrange()
        if len(self._blocks):
            self._evaluate()  # so that nothing compiles in the game's next step

    def _none_over(self, body: SoftBody) -> NDArray[np.bool_]:
        return np.zeros(len(self._scene.bodies[body.index].tet_vertices), dtype=np.bool_)

    def renew(self, body: SoftBody) -> None:
        """Go on with a body that has lost tetrahedra; those over a threshold count as new."""
        for (kind, watched), watch in list(self._watches.items()):
            if watched is body:
                self.set(kind, body, watch.threshold)

    @property
    def notes(self) -> list[WatchNote]:
        """Of all bodies that are alive."""
        return [
            WatchNote(kind, serial_of(body), watch.threshold, np.packbits(watch.is_over).tobytes())
            for (kind, body), watch in self._watches.items()
            if body.is_alive
        ]

    def recall(self, notes: list[WatchNote], known: Known) -> None:
        """Go on as in an earlier state. Watches that were set since stay, and all over them count as new."""
        if not notes and not self._watches:
            return
        for (_, body), watch in self._watches.items():
            watch.is_over = self._none_over(body)
        for note in notes:
            found = known.body(note.serial)
            if found is not None:
                bits = np.frombuffer(note.is_over, dtype=np.uint8)
                is_over = np.unpackbits(bits, count=len(self._none_over(found))).astype(np.bool_)
                self._watches[note.kind, found] = _Watch(found, note.threshold, is_over)
        self._arrange()

    def _arrange(self) -> None:
        bodies = sorted({body for _, body in self._watches}, key=lambda body: body.index)
        ranges = [self._scene.ranges[body.index].blocks for body in bodies]
        self._places, start = {}, 0
        for body, (first, last) in zip(bodies, ranges, strict=True):
            count = len(self._scene.bodies[body.index].tet_vertices)
            self._places[body] = slice(start, start + count)
            start += (last - first) * LANES
        rows = [np.arange(*place, dtype=np.int32) for place in ranges]
        self._blocks = np.concatenate([np.zeros(0, dtype=np.int32), *rows])
        pulls = [self._watches.get((TearCandidates, body)) for body in bodies]
        limits = [NO_LIMIT if watch is None else watch.threshold for watch in pulls]
        self._limits = np.repeat(limits, [len(blocks) for blocks in rows]).astype(np.float32)
        self._read = np.zeros((start, 5), dtype=np.float32)

    def _evaluate(self) -> None:
        read_stress(self._state, self._program, self._blocks, self._limits, self._read)

    def warm_up(self) -> None:
        """Read a stress, and take no note."""
        read_stress(
            *(self._state, self._program, np.zeros(1, np.int32), np.zeros(1, np.float32)),
            np.empty((LANES, 5), np.float32),
        )

    def events(self, kind: type[Event], step: int, time: float) -> Iterator[Event]:
        """Of one kind, in the order of bodies, of what `look` has seen."""
        for body, place in self._places.items():
            watch = self._watches.get((kind, body))
            if watch is None:
                continue
            column = PRINCIPAL if kind is TearCandidates else VON_MISES
            rows = watch.newly_over(self._read[place, column])
            if not len(rows):
                continue
            names = self._scene.bodies[body.index].tet_order[rows].astype(np.int64)
            order = np.argsort(names)
            found = self._read[place][rows[order]].astype(np.float64)
            if kind is TearCandidates:
                yield TearCandidates(step, time, body, names[order], found[:, PRINCIPAL], found[:, AXIS])
            else:
                yield StressExceeded(step, time, body, names[order], found[:, VON_MISES])

    def look(self) -> None:
        """Evaluate the stress of all watched bodies that are alive."""
        gone = [key for key in self._watches if not key[1].is_alive]
        for key in gone:
            del self._watches[key]
        if gone:
            self._arrange()
        if len(self._blocks):
            self._evaluate()
