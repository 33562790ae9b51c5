"""What has happened in the steps since it was last asked."""

from taichi_soft.events.event_state import Known, Memory
from taichi_soft.events.kinds import (
    ContactBegan,
    ContactEnded,
    Event,
    FellAsleep,
    Froze,
    Released,
    StressExceeded,
    TearCandidates,
    Torn,
    Woke,
)
from taichi_soft.events.log import EventLog, Listener
from taichi_soft.events.observer import Observer

__all__ = [
    "ContactBegan",
    "ContactEnded",
    "Event",
    "EventLog",
    "FellAsleep",
    "Froze",
    "Known",
    "Listener",
    "Memory",
    "Observer",
    "Released",
    "StressExceeded",
    "TearCandidates",
    "Torn",
    "Woke",
]
