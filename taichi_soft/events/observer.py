"""Find the events of each step from the state of the world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from taichi_soft.bodies.law_program import Program
from taichi_soft.bodies.layout import Scene
from taichi_soft.bodies.soft_body import SoftBody, record_of
from taichi_soft.bodies.status import ABSENT, ACTIVE, ASLEEP
from taichi_soft.contact.collider import Collider
from taichi_soft.contact.colliders import Colliders
from taichi_soft.contact.fields import PAIR_ROWS, ContactCapacity
from taichi_soft.contact.filters import may_meet
from taichi_soft.contact.kernels.touches import OF_BODY, read_touches
from taichi_soft.contact.sensors import inside_sensors
from taichi_soft.events.contacts import Contacts, Key
from taichi_soft.events.event_state import EventState, HandleLookup
from taichi_soft.events.kinds import (
    CONTACT_KINDS,
    SENSOR_KINDS,
    SLEEP_KINDS,
    STRESS_KINDS,
    Event,
    FellAsleep,
    Froze,
    StressExceeded,
    TearCandidates,
    Woke,
)
from taichi_soft.events.sensed import Pair, Sensed
from taichi_soft.events.watched_stress import StressWatches


def touch_rows(room: ContactCapacity, bodies: int) -> int:
    """Return the largest number of touching pairs that can be read after a step."""
    return bodies * (room.colliders + (PAIR_ROWS if room.soft else 0)) + 1


class Observer:
    """Finds events by comparing the state after each step with the state before the step."""

    def __init__(
        self,
        state: Any,
        program: Program,
        scene: Scene,
        slots: Sequence[SoftBody | None],
        colliders: Colliders | None,
    ) -> None:
        """Create an observer of a world.

        Args: state: fields of the world. slots: body in each slot. colliders: None without contact.
        """
        self._state = state
        self._slots = slots
        self._colliders = colliders
        self._contacts = Contacts()
        self._sensed = Sensed()
        self._sleepers: dict[int, SoftBody] = {}
        self._frozen: list[SoftBody] = []
        self.stress = StressWatches(state, program, scene)
        room = state.capacity.contact
        rows = touch_rows(room, len(slots))
        self._read = np.zeros(len(slots) + 2, dtype=np.int32)  # `status` of `read_touches`
        self._status = self._read[:-2]  # status of the body in each slot after the last step
        self._pairs = np.zeros((rows, 3), dtype=np.int32)
        self._impulses = np.zeros((rows, 3), dtype=np.float32)
        self.lost_touches = False  # True if more pairs touched in the last step than can be recorded

    @property
    def has_contacts(self) -> bool:
        """True if the world was built with colliders or soft contact."""
        return self._colliders is not None

    def begin(self, kinds: frozenset[type[Event]], before: frozenset[type[Event]]) -> None:
        """Observe `kinds` from now on, instead of the kinds in `before`."""
        if self.has_contacts and self._state.capacity.contact.soft:
            self._state.soft.records_touches[None] = int(bool(kinds & CONTACT_KINDS))
        if kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._read_step()
        if not before & CONTACT_KINDS:
            self._contacts = Contacts()
        if not before & SENSOR_KINDS:
            self._sensed = Sensed()
        if not before & SLEEP_KINDS:
            self._sleepers = self._sleeping()

    def warm_up(self) -> None:
        """Read stresses and touches without recording events, so that the kernels are compiled.

        Reading clears the touches.
        """
        self.stress.warm_up()
        self._state.body_filter.to_numpy()  # compiles the kernel of `end_forbidden_contacts`
        pairs, impulses = np.empty_like(self._pairs), np.empty_like(self._impulses)
        read_touches(self._state, len(self._slots), self._read.copy(), pairs, impulses)

    def record_frozen(self, body: SoftBody) -> None:
        """Record that the current step froze a body."""
        self._frozen.append(body)

    def events(self, kinds: frozenset[type[Event]], step: int, time: float, dt: float) -> Iterator[Event]:
        """Yield the events of these kinds in a step, in the order of `KINDS`.

        Args: step, time, dt: index of the step; its end [s]; its length [s].
        """
        if kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._read_step()
        else:
            self.lost_touches = False
        if kinds & CONTACT_KINDS:
            moving = set(np.flatnonzero(self._status == ACTIVE).tolist())
            count = self._read[-1]
            touches = dict(
                zip(
                    map(tuple, self._pairs[:count].tolist()),
                    map(tuple, self._impulses[:count].tolist()),
                    strict=True,
                )
            )
            began, ended = self._contacts.update(touches, self._handles, moving, step, time, dt)
            yield from began
            yield from ended
        if kinds & STRESS_KINDS:
            self.stress.update()
            yield from self.stress.events(StressExceeded, step, time)
            yield from self.stress.events(TearCandidates, step, time)
        if kinds & SLEEP_KINDS:
            before, now = self._sleepers, self._sleeping()
            self._sleepers = now
            yield from (FellAsleep(step, time, b) for slot, b in now.items() if before.get(slot) is not b)
            woken = (body for slot, body in before.items() if now.get(slot) is not body)
            yield from (
                Woke(step, time, body)
                for body in woken
                if body.is_alive and self._status[body.index] < ABSENT  # not if it was switched off
            )
        frozen, self._frozen = self._frozen, []
        for body in frozen:
            yield Froze(step, time, body)
        if kinds & SENSOR_KINDS and self._colliders is not None:
            inside = inside_sensors(self._state, len(self._slots), self._colliders.sensors)
            entered, left = self._sensed.update(inside, self._handles_inside, step, time)
            yield from entered
            yield from left

    def end_forbidden_contacts(self) -> None:
        """Make the contacts of bodies that were switched off, and of pairs whose groups and masks forbid
        contact, end in the next step.
        """
        bodies, status = self._state.body_filter.to_numpy(), self._state.body_status.to_numpy()

        def may_touch(key: Key) -> bool:
            a, kind, b = key
            if status[a] > ABSENT or (kind == OF_BODY and status[b] > ABSENT):
                return False
            if kind == OF_BODY:
                return may_meet(bodies[a].tolist(), bodies[b].tolist())
            assert self._colliders is not None
            collider = self._colliders.handle(b)
            return may_meet(bodies[a].tolist(), (collider.group, collider.mask))

        self._contacts.end_unless(may_touch)

    def save(self, kinds: frozenset[type[Event]]) -> EventState:
        """Return the state on which the events of the given kinds depend."""
        return EventState(
            self._status.copy() if kinds & (CONTACT_KINDS | SLEEP_KINDS) else None,
            self._contacts.rows if kinds & CONTACT_KINDS else None,
            self._sensed.rows if kinds & SENSOR_KINDS else None,
            self.stress.entries if kinds & STRESS_KINDS else [],
        )

    def restore(
        self, kinds: frozenset[type[Event]], saved: EventState, step: int, lookup: HandleLookup
    ) -> None:
        """Continue after a restored step.

        Args:
            kinds: kinds of events that are recorded now.
            saved: state of the kinds that were recorded when `step` was stored.
        """
        self._frozen = []
        if kinds & CONTACT_KINDS and saved.contacts is not None:
            self._contacts.restore(saved.contacts, lookup)
        else:
            self._contacts = Contacts()
        if kinds & SENSOR_KINDS and saved.inside is not None:
            self._sensed.restore(saved.inside, lookup)
        else:
            self._sensed = Sensed()
        if saved.status is not None:
            self._status[:] = saved.status
            # The slot of a body that slept can now contain a body that was spawned after the last step.
            asleep = self._sleeping().items()
            self._sleepers = {slot: body for slot, body in asleep if record_of(body).first_step < step}
        elif kinds & (CONTACT_KINDS | SLEEP_KINDS):
            self._read_step()
            self._sleepers = self._sleeping()
        self.stress.restore(saved.watches if kinds & STRESS_KINDS else [], lookup)

    def _read_step(self) -> None:
        """Read the touches of the last step, and the status of all bodies."""
        read_touches(self._state, len(self._slots), self._read, self._pairs, self._impulses)
        self.lost_touches = bool(self._read[-2])

    def _handles(self, key: Key) -> tuple[SoftBody, Collider | SoftBody]:
        a, kind, b = key
        body = self._slots[a]
        assert body is not None
        assert self._colliders is not None
        other = self._slots[b] if kind == OF_BODY else self._colliders.handle(b)
        assert other is not None
        return body, other

    def _handles_inside(self, pair: Pair) -> tuple[SoftBody, Collider]:
        body = self._slots[pair[0]]
        assert body is not None
        assert self._colliders is not None
        return body, self._colliders.handle(pair[1])

    def _sleeping(self) -> dict[int, SoftBody]:
        """Return the sleeping bodies by slot, in ascending order of the slots."""
        slots = np.flatnonzero(self._status == ASLEEP).tolist()
        return {slot: body for slot in slots if (body := self._slots[slot]) is not None}
