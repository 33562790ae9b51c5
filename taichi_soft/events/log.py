"""What has happened in a world since it was last asked, and who wants to hear of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.errors import OptionError, StateError
from taichi_soft.events.event_state import Known, Memory
from taichi_soft.events.kinds import CONTACT_KINDS, KINDS, Event, Released, Torn
from taichi_soft.events.observer import Observer

MOST_EVENTS = 10_000
"""That wait to be drained; then the oldest are dropped."""

_WAY_OUT = "call drain_events in every frame, or record fewer kinds"


class Listener:
    """A function that hears of events until `remove` is called."""

    def __init__(self, kind: type[Event], function: Callable[[Any], object]) -> None:
        """Made by `World.on`."""
        self.kind = kind
        self.function = function
        self.is_active = True

    def remove(self) -> None:
        """Hear of nothing more, also of what waits already."""
        self.is_active = False


class EventLog:
    """The events of one world. Nothing is recorded until somebody asks."""

    def __init__(self, observer: Observer) -> None:
        """Args: observer: who looks at the world."""
        self._observer = observer
        self._kinds: frozenset[type[Event]] = frozenset()
        self._was_asked = False
        self._waiting: deque[Event] = deque()
        self._heard = 0  # of those that wait, by listeners
        self._listeners: list[Listener] = []
        self._is_draining = False
        self._has_lost = False  # since the last drain
        self.dropped = 0

    def record(self, kinds: Iterable[type[Event]]) -> None:
        """See `World.record_events`."""
        try:
            listed = list(kinds)
        except TypeError:
            raise OptionError(f"kinds must be a list of classes of events, got {kinds!r}") from None
        chosen: frozenset[type[Event]] = frozenset().union(*[self._parts(kind) for kind in listed])
        self._record(chosen)

    def _parts(self, kind: Any) -> frozenset[type[Event]]:
        """The kinds that a class stands for. Raises: see `World.record_events`."""
        is_class = isinstance(kind, type) and issubclass(kind, Event)
        parts = frozenset(part for part in KINDS if is_class and issubclass(part, kind))
        if not parts:
            raise OptionError(f"kind must be a class of events such as ContactBegan, or Event, got {kind!r}")
        if parts <= CONTACT_KINDS and not self._observer.knows_contacts:
            raise StateError(
                f"{kind.__name__} is not seen in a world without colliders and soft_contact: make it with "
                "collider_room=1, then its floor is a collider too"
            )
        return parts

    def _record(self, kinds: frozenset[type[Event]]) -> None:
        if not self._observer.knows_contacts:
            kinds = kinds - CONTACT_KINDS
        self._observer.begin(kinds, self._kinds)
        self._kinds, self._was_asked = kinds, True

    @property
    def is_recording(self) -> bool:
        """Whether somebody asked for events."""
        return self._was_asked

    def on(self, kind: type[Event], function: Callable[[Any], object]) -> Listener:
        """See `World.on`."""
        parts = self._parts(kind)
        if not callable(function):
            raise OptionError(f"function must be callable with an event, got {function!r}")
        self._record(self._kinds | parts)
        listener = Listener(kind, function)
        self._listeners.append(listener)
        return listener

    def watch(self, kind: type[Event], body: SoftBody, threshold: float | None) -> None:
        """Look at a body's stress for one of `STRESS_KINDS`, from a threshold [Pa] on; None for no longer."""
        self._observer.stress.set(kind, body, threshold)
        if threshold is not None:
            self._record(self._kinds | {kind})

    def warm_up(self) -> None:
        """Look at the world as after a step, and tell nobody: see `World.warm_up`."""
        self._observer.warm_up()

    def renew_watches(self, body: SoftBody) -> None:
        """Look at the tetrahedra that a cut has left of a body."""
        self._observer.stress.renew(body)

    def note_frozen(self, body: SoftBody) -> None:
        """The step that is being made has frozen a body."""
        if self._kinds:
            self._observer.note_frozen(body)

    def note_torn(self, step: int, time: float, body: SoftBody, pieces: tuple[SoftBody, ...]) -> None:
        """What the step that ended at `time` [s] has pulled too hard has torn a body."""
        if Torn in self._kinds:
            self._waiting.append(Torn(step, time, body, pieces))

    def note_released(self, step: int, time: float, body: SoftBody, handles: tuple[Any, ...]) -> None:
        """A change of its level before `step`, at `time` [s], has released what held a body."""
        if handles and Released in self._kinds:
            self._waiting.append(Released(step, time, body, handles))

    def remember(self) -> Memory:
        """What the events of coming steps depend on."""
        return self._observer.remember(self._kinds)

    def forget_since(self, step: int) -> None:
        """Drop the events that wait from that step on: it was undone."""
        while self._waiting and self._waiting[-1].step >= step:
            self._waiting.pop()
        self._heard = min(self._heard, len(self._waiting))

    def recall(self, memory: Memory, step: int, known: Known) -> None:
        """Look at the world, which was put back to a state of that step count, as after that step."""
        self._observer.recall(self._kinds, memory, step, known)

    def collect(self, step: int, time: float, dt: float) -> str:
        """Take down what happened in a step.

        Args:
            step, time, dt: its number, its end [s], its length [s].
        Returns: for the first time since a drain, why something is lost; "" where nothing is.
        """
        if not self._kinds:
            return ""
        for event in self._observer.events(self._kinds, step, time, dt):
            if type(event) in self._kinds:
                self._waiting.append(event)
        loss = ""
        while len(self._waiting) > MOST_EVENTS:
            self._waiting.popleft()
            self._heard = max(self._heard - 1, 0)
            self.dropped += 1
            loss = f"more than {MOST_EVENTS:,} events wait and the oldest are dropped: {_WAY_OUT}"
        if self._observer.lost_touches:
            loss = "more pairs of bodies touch than can be told apart: some contacts have no events"
        is_news, self._has_lost = not self._has_lost, self._has_lost or bool(loss)
        return loss if is_news else ""

    def drain(self) -> list[Event]:
        """See `World.drain_events`."""
        if not self._was_asked:
            raise StateError("no events are recorded: call record_events() once, or on() with a listener")
        if self._is_draining:
            raise StateError("drain_events was called by a listener: it hears of all that waits anyway")
        self._is_draining = True
        try:
            self._tell(list(self._waiting)[self._heard :])
        finally:
            self._is_draining = False
        self._has_lost = False
        heard, self._heard = self._heard, 0
        return [self._waiting.popleft() for _ in range(heard)]

    def _tell(self, events: list[Event]) -> None:
        """Let all listeners hear of events. Raises: the first exception of one of them, at the end."""
        self._heard += len(events)
        self._listeners = [listener for listener in self._listeners if listener.is_active]
        listeners, errors = tuple(self._listeners), []  # who comes meanwhile hears of what comes later
        for event in events:
            for listener in listeners:
                if listener.is_active and isinstance(event, listener.kind):
                    try:
                        listener.function(event)
                    except Exception as error:
                        errors.append(error)
        if errors:
            raise errors[0]
