"""Record events during steps, and send them to listeners and callers."""

from taichi_soft.events.event_state import EventState, HandleLookup
from taichi_soft.events.kinds import (
    Broke,
    ContactBegan,
    ContactEnded,
    Entered,
    Event,
    FellAsleep,
    Froze,
    Left,
    Released,
    StressExceeded,
    TearCandidates,
    Torn,
    Woke,
)
from taichi_soft.events.log import EventLog, Listener
from taichi_soft.events.observer import Observer

__all__ = [
    "Broke",
    "ContactBegan",
    "ContactEnded",
    "Entered",
    "Event",
    "EventLog",
    "EventState",
    "FellAsleep",
    "Froze",
    "HandleLookup",
    "Left",
    "Listener",
    "Observer",
    "Released",
    "StressExceeded",
    "TearCandidates",
    "Torn",
    "Woke",
]
