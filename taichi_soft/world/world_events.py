"""Methods of a world for events."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from taichi_soft.events import Event, Listener
from taichi_soft.world.world_parts import WorldParts

Happened = TypeVar("Happened", bound=Event)


class WorldEvents(WorldParts):
    """Methods of a world that record and return events."""

    def record_events(self, kinds: Iterable[type[Event]] = (Event,)) -> None:
        """Record events of these kinds only, from the next step on. `drain_events` returns the events.

        Contacts that already exist are reported as new contacts in that step. `StressExceeded` and
        `TearCandidates` are sent only for bodies on which you called `Body.watch_stress` or
        `Body.watch_tearing`.
        Args:
            kinds: classes of events; `Event` means all kinds that this world supports; an empty list means
                no events.
        Raises: OptionError for a class that is not an event; StateError before `build`, and for contacts in a
            world without colliders and soft contact.
        """
        self._built.events.record(kinds)

    def on(self, kind: type[Happened], function: Callable[[Happened], object]) -> Listener:
        """Call a function for each event of a kind, and record that kind.

        `drain_events` calls the function, never during a step, so the function can make any call that is
        allowed between steps. `StressExceeded` and `TearCandidates` are sent only for bodies on which you
        called `Body.watch_stress` or `Body.watch_tearing`.
        Args:
            kind: a class of events; `Event` means all kinds that this world supports.
            function: function that is called with each event.
        Returns: a listener. Its method `remove` ends the calls.
        Raises: as `record_events`; OptionError for a function that is not callable.
        Example:
            listener = world.on(ContactBegan, lambda event: print(event.a, "touches", event.b))
            world.step(1 / 60)
            world.drain_events()  # calls the listeners
            listener.remove()
        """
        return self._built.events.on(kind, function)

    def drain_events(self) -> list[Event]:
        """Call the listeners, and return all events since the last call.

        Events are sorted by step, then by kind (released before the step, contacts begun and ended, stress,
        tear candidates, sleep, waking, freezing, sensors entered and left, tearing), then by the indices of
        bodies. If more than 10,000 events wait, the oldest events are dropped, and the step warns with a
        `DroppedEventsWarning`.

        If a listener raises an exception, the other listeners are still called, and the first exception is
        raised at the end. The next call then returns the same events together with new events, and calls no
        listener twice for an event.
        Raises: StateError before `build`, before any kind is recorded, and inside a listener.
        """
        return self._built.events.drain()

    @property
    def dropped_events(self) -> int:
        """Total number of events that were dropped because too many were waiting."""
        return self._built.events.dropped
