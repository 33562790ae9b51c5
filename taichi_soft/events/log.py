"""Queue of the events of a world, and its listeners."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.control.attachments import Attachment
from taichi_soft.control.joints import Joint
from taichi_soft.core.conflicts import FLAT
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.events.event_state import EventState, HandleLookup
from taichi_soft.events.kinds import CONTACT_KINDS, KINDS, SENSOR_KINDS, Broke, Event, Released, Torn
from taichi_soft.events.observer import Observer

MAX_EVENTS = 10_000
"""Largest number of events in the queue. If more events are recorded, the oldest events are dropped."""

_DRAIN_HINT = "call drain_events in every frame, or record fewer kinds"


class Listener:
    """A function that receives events until `remove` is called."""

    def __init__(self, kind: type[Event], function: Callable[[Any], object]) -> None:
        """Use `World.on` instead."""
        self.kind = kind
        self.function = function
        self.is_active = True

    def remove(self) -> None:
        """Stop receiving events, including those already in the queue."""
        self.is_active = False


class EventLog:
    """The events of one world. Nothing is recorded before the first call of `record` or `on`."""

    def __init__(self, observer: Observer) -> None:
        """Create a log that records nothing. Args: observer: finds the events of each step."""
        self._observer = observer
        self._kinds: frozenset[type[Event]] = frozenset()
        self._is_recording = False
        self._waiting: deque[Event] = deque()
        self._delivered = 0  # number of queued events that listeners have received
        self._listeners: list[Listener] = []
        self._is_draining = False
        self._has_warned = False  # True if a loss was reported after the last drain
        self.dropped = 0

    def record(self, kinds: Iterable[type[Event]]) -> None:
        """See `World.record_events`."""
        try:
            listed = list(kinds)
        except TypeError:
            raise OptionError(f"kinds must be a list of classes of events, got {kinds!r}") from None
        recorded: frozenset[type[Event]] = frozenset().union(*[self._kinds_of(kind) for kind in listed])
        self._record(recorded)

    def _kinds_of(self, kind: Any) -> frozenset[type[Event]]:
        """Return the kinds of events that are `kind` or a subclass of `kind`.

        Raises: see `World.record_events`.
        """
        is_class = isinstance(kind, type) and issubclass(kind, Event)
        kinds = frozenset(part for part in KINDS if is_class and issubclass(part, kind))
        if not kinds:
            raise OptionError(
                f"kind must be a class of events, for example ContactBegan or Event, got {kind!r}"
            )
        if kinds <= CONTACT_KINDS | SENSOR_KINDS and not self._observer.has_contacts:
            raise StateError(FLAT.message(feature=kind.__name__))
        return kinds

    def _record(self, kinds: frozenset[type[Event]]) -> None:
        if not self._observer.has_contacts:
            kinds = kinds - CONTACT_KINDS - SENSOR_KINDS
        self._observer.begin(kinds, self._kinds)
        self._kinds, self._is_recording = kinds, True

    @property
    def is_recording(self) -> bool:
        """True if events are recorded."""
        return self._is_recording

    def on(self, kind: type[Event], function: Callable[[Any], object]) -> Listener:
        """See `World.on`."""
        kinds = self._kinds_of(kind)
        if not callable(function):
            raise OptionError(f"function must be callable with an event, got {function!r}")
        self._record(self._kinds | kinds)
        listener = Listener(kind, function)
        self._listeners.append(listener)
        return listener

    def watch(self, kind: type[Event], body: SoftBody, threshold: float | None) -> None:
        """Record events of `kind` when a body's stress exceeds a threshold [Pa]; None stops the watch."""
        self._observer.stress.set(kind, body, threshold)
        if threshold is not None:
            self._record(self._kinds | {kind})

    def warm_up(self) -> None:
        """Run the kernels that find events, without recording events: see `World.warm_up`."""
        self._observer.warm_up()

    def end_forbidden_contacts(self) -> None:
        """Make the contacts of pairs that can no longer touch end in the next step."""
        if self._kinds & CONTACT_KINDS:
            self._observer.end_forbidden_contacts()

    def renew_watches(self, body: SoftBody) -> None:
        """Update the watches of a body that lost tetrahedra in a cut."""
        self._observer.stress.renew(body)

    def record_frozen(self, body: SoftBody) -> None:
        """Record that the current step froze a body."""
        if self._kinds:
            self._observer.record_frozen(body)

    def record_torn(self, step: int, time: float, body: SoftBody, pieces: tuple[SoftBody, ...]) -> None:
        """Record that the step that ended at `time` [s] tore a body."""
        if Torn in self._kinds:
            self._waiting.append(Torn(step, time, body, pieces))

    def record_released(self, step: int, time: float, body: SoftBody, handles: tuple[Any, ...]) -> None:
        """Record that a change of level before `step`, at `time` [s], released handles of a body."""
        if handles and Released in self._kinds:
            self._waiting.append(Released(step, time, body, handles))

    def record_broken(
        self, step: int, time: float, handle: Joint | Attachment, impulse: NDArray[np.float64]
    ) -> None:
        """Record that a joint or an attachment broke after the step that ended at `time` [s]."""
        if Broke in self._kinds:
            other = handle.other if isinstance(handle, Joint) else handle.frame
            self._waiting.append(Broke(step, time, handle.body, other, handle, impulse))

    def save(self) -> EventState:
        """Return the state on which the events of later steps depend."""
        return self._observer.save(self._kinds)

    def drop_since(self, step: int) -> None:
        """Drop the queued events of `step` and of later steps, because these steps were undone."""
        while self._waiting and self._waiting[-1].step >= step:
            self._waiting.pop()
        self._delivered = min(self._delivered, len(self._waiting))

    def restore(self, saved: EventState, step: int, lookup: HandleLookup) -> None:
        """Continue after a restored step.

        Args: saved: state that was stored with the step. lookup: lookup of handles that the caller holds.
        """
        self._observer.restore(self._kinds, saved, step, lookup)

    def collect(self, step: int, time: float, dt: float) -> str:
        """Record the events of a step.

        Args:
            step, time, dt: index of the step; its end [s]; its length [s].
        Returns: the reason why events were lost, if this is the first loss since a drain; otherwise "".
        """
        if not self._kinds:
            return ""
        for event in self._observer.events(self._kinds, step, time, dt):
            if type(event) in self._kinds:
                self._waiting.append(event)
        loss = ""
        while len(self._waiting) > MAX_EVENTS:
            self._waiting.popleft()
            self._delivered = max(self._delivered - 1, 0)
            self.dropped += 1
            loss = f"more than {MAX_EVENTS:,} events are queued and the oldest are dropped: {_DRAIN_HINT}"
        if self._observer.lost_touches:
            loss = "more pairs of bodies touch than can be recorded: some contacts have no events"
        is_new, self._has_warned = not self._has_warned, self._has_warned or bool(loss)
        return loss if is_new else ""

    def drain(self) -> list[Event]:
        """See `World.drain_events`."""
        if not self._is_recording:
            raise StateError("no events are recorded: call record_events() once, or on() with a listener")
        if self._is_draining:
            raise StateError("drain_events was called by a listener, which receives all queued events anyway")
        self._is_draining = True
        try:
            self._notify(list(self._waiting)[self._delivered :])
        finally:
            self._is_draining = False
        self._has_warned = False
        delivered, self._delivered = self._delivered, 0
        return [self._waiting.popleft() for _ in range(delivered)]

    def _notify(self, events: list[Event]) -> None:
        """Send events to all listeners.

        Raises: the first exception of a listener, after all listeners were called.
        """
        self._delivered += len(events)
        self._listeners = [listener for listener in self._listeners if listener.is_active]
        listeners, errors = tuple(self._listeners), []  # listeners added now receive only later events
        for event in events:
            for listener in listeners:
                if listener.is_active and isinstance(event, listener.kind):
                    try:
                        listener.function(event)
                    except Exception as error:
                        errors.append(error)
        if errors:
            raise errors[0]
