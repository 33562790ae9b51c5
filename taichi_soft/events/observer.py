"""Who looks at a world after each step and says what has happened in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.soft_body import SoftBody, record_of
from taichi_soft.bodies.status import ACTIVE, ASLEEP
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import Colliders
from taichi_soft.contact.fields import PAIR_ROWS, ContactCapacity
from taichi_soft.contact.kernels.touches import OF_BODY, read_touches
from taichi_soft.events.contacts import Contacts, Key
from taichi_soft.events.event_state import Known, Memory
from taichi_soft.events.kinds import (
    CONTACT_KINDS,
    SLEEP_KINDS,
    STRESS_KINDS,
    Event,
    FellAsleep,
    Froze,
    StressExceeded,
    TearCandidates,
    Woke,
)
from taichi_soft.events.stress import StressWatches


def touch_rows(room: ContactCapacity, bodies: int) -> int:
    """How many pairs can touch in a step."""
    return bodies * (room.colliders + (PAIR_ROWS if room.soft else 0)) + 1


class Observer:
    """Compares each step with the one before it."""

    def __init__(
        self,
        state: Any,
        program: Program,
        scene: Scene,
        slots: Sequence[SoftBody | None],
        colliders: Colliders | None,
    ) -> None:
        """Args: state: all fields of a world; slots: the body in each; colliders: None without contact."""
        self._state = state
        self._slots = slots
        self._colliders = colliders
        self._contacts = Contacts()
        self._sleepers: dict[int, SoftBody] = {}
        self._frozen: list[SoftBody] = []
        self.stress = StressWatches(state, program, scene)
        room = state.capacity.contact
        rows = touch_rows(room, len(slots))
        self._read = np.zeros(len(slots) + 2, dtype=np.int32)  # `status` of `read_touches`
        self._status = self._read[:-2]  # of each slot, after the last step
        self._who = np.zeros((rows, 3), dtype=np.int32)
        self._impulses = np.zeros((rows, 3), dtype=np.float32)
        self.lost_touches = False  # whether in the last step more pairs of bodies touched than have room

    @property
    def knows_contacts(self) -> bool:
        """Whether the world was built with colliders or soft contact."""
        return self._colliders is not None

    def begin(self, kinds: frozenset[type[Event]], before: frozenset[type[Event]]) -> None:
        """Look for `kinds` from now on, where it was for those `before`."""
        if self.knows_contacts and self._state.capacity.contact.soft:
            self._state.soft.records_touches[None] = int(bool(kinds & CONTACT_KINDS))
        if kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._look()
        if not before & CONTACT_KINDS:
            self._contacts = Contacts()
        if not before & SLEEP_KINDS:
            self._sleepers = self._sleeping()

    def warm_up(self) -> None:
        """Read stress and what touches, and take no note. What touched is forgotten, as where it is read."""
        self.stress.warm_up()
        who, impulses = np.empty_like(self._who), np.empty_like(self._impulses)
        read_touches(self._state, len(self._slots), self._read.copy(), who, impulses)

    def note_frozen(self, body: SoftBody) -> None:
        """The step that is being made has frozen a body."""
        self._frozen.append(body)

    def events(self, kinds: frozenset[type[Event]], step: int, time: float, dt: float) -> Iterator[Event]:
        """What happened in the step that ends at `time` [s], of some kinds, in their order."""
        if kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._look()
        else:
            self.lost_touches = False
        if kinds & CONTACT_KINDS:
            moving = set(np.flatnonzero(self._status == ACTIVE).tolist())
            count = self._read[-1]
            touches = dict(
                zip(
                    map(tuple, self._who[:count].tolist()),
                    map(tuple, self._impulses[:count].tolist()),
                    strict=True,
                )
            )
            began, ended = self._contacts.follow(touches, self._handles, moving, step, time, dt)
            yield from began
            yield from ended
        if kinds & STRESS_KINDS:
            self.stress.look()
            yield from self.stress.events(StressExceeded, step, time)
            yield from self.stress.events(TearCandidates, step, time)
        if kinds & SLEEP_KINDS:
            before, now = self._sleepers, self._sleeping()
            self._sleepers = now
            yield from (FellAsleep(step, time, b) for slot, b in now.items() if before.get(slot) is not b)
            woken = (body for slot, body in before.items() if now.get(slot) is not body)
            yield from (Woke(step, time, body) for body in woken if body.is_alive)
        frozen, self._frozen = self._frozen, []
        for body in frozen:
            yield Froze(step, time, body)

    def remember(self, kinds: frozenset[type[Event]]) -> Memory:
        """What events of some kinds depend on."""
        return Memory(
            self._status.copy() if kinds & (CONTACT_KINDS | SLEEP_KINDS) else None,
            self._contacts.rows if kinds & CONTACT_KINDS else None,
            self.stress.notes if kinds & STRESS_KINDS else [],
        )

    def recall(self, kinds: frozenset[type[Event]], memory: Memory, step: int, known: Known) -> None:
        """The world was put back to a state of that step count: go on as after it, where that is known."""
        self._frozen = []
        if kinds & CONTACT_KINDS and memory.contacts is not None:
            self._contacts.recall(memory.contacts, known)
        else:
            self._contacts = Contacts()
        if memory.status is not None:
            self._status[:] = memory.status
            # Who came after the last step took the slot of one who may have slept in it.
            asleep = self._sleeping().items()
            self._sleepers = {slot: body for slot, body in asleep if record_of(body).first_step < step}
        elif kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._look()
            self._sleepers = self._sleeping()
        self.stress.recall(memory.watches if kinds & STRESS_KINDS else [], known)

    def _look(self) -> None:
        """Read who touched whom in the last step, and who sleeps."""
        read_touches(self._state, len(self._slots), self._read, self._who, self._impulses)
        self.lost_touches = bool(self._read[-2])

    def _handles(self, key: Key) -> tuple[SoftBody, Collider | SoftBody]:
        a, kind, b = key
        body = self._slots[a]
        assert body is not None
        assert self._colliders is not None
        other = self._slots[b] if kind == OF_BODY else self._colliders.handle(b)
        assert other is not None
        return body, other

    def _sleeping(self) -> dict[int, SoftBody]:
        """Sleeping bodies by their slots, ascending."""
        slots = np.flatnonzero(self._status == ASLEEP).tolist()
        return {slot: body for slot in slots if (body := self._slots[slot]) is not None}
