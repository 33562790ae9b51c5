"""What happened in a world, for those who want to hear of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

from taichi_soft.events import Event, Listener
from taichi_soft.world.world_parts import WorldParts

Happened = TypeVar("Happened", bound=Event)


class WorldEvents(WorldParts):
    """What of a world tells what happened."""

    def record_events(self, kinds: Iterable[type[Event]] = (Event,)) -> None:
        """Record events of these kinds, and no others, from the next step on, for `drain_events`.

        What touches already counts as a contact that begins in that step. `StressExceeded` and
        `TearCandidates` come of bodies with `Body.watch_stress` and `Body.watch_tearing` only.
        Args:
            kinds: classes of events; `Event` stands for all that this world has, an empty list for none.
        Raises: OptionError for what is no class of events; StateError before `build`, and for contacts in a
            world without colliders and soft contact.
        """
        self._built.events.record(kinds)

    def on(self, kind: type[Happened], function: Callable[[Happened], object]) -> Listener:
        """Let a function hear of all events of a kind, and record that kind.

        It is called by `drain_events`, never within a step, so it may do what can be done between two steps.
        Of `StressExceeded` and `TearCandidates` it hears only for bodies with a `Body.watch_stress` or
        `Body.watch_tearing`.
        Args:
            kind: a class of events; `Event` for all that this world has.
            function: takes the event.
        Returns: what `remove` ends it with.
        Raises: as `record_events`; OptionError for what cannot be called.
        Example:
            listener = world.on(ContactBegan, lambda event: print(event.a, "touches", event.b))
            world.step(1 / 60)
            world.drain_events()  # calls the listeners
            listener.remove()
        """
        return self._built.events.on(kind, function)

    def drain_events(self) -> list[Event]:
        """All events since the last call, after those who listen have heard of them.

        They come step by step; within a step by kind (released before it, contacts begun and ended, stress,
        tear candidates, sleep, waking, freezing, tearing), then by the indices of bodies. Up to 10,000 wait,
        then the oldest are dropped, with a `DroppedEventsWarning` in the step.

        An exception of a listener keeps no other from hearing of any event: the first is raised at the end.
        The next call then returns these events with those that came since, and listeners hear of none twice.
        Raises: StateError before `build`, before anything is recorded, and from within a listener.
        """
        return self._built.events.drain()

    @property
    def dropped_events(self) -> int:
        """How many were dropped so far because too many waited."""
        return self._built.events.dropped
