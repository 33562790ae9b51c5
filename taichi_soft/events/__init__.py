"""What has happened in the steps since it was last asked."""

from taichi_soft.events.kinds import (
    ContactBegan,
    ContactEnded,
    Event,
    FellAsleep,
    Froze,
    StressExceeded,
    TearCandidates,
    Woke,
)
from taichi_soft.events.log import EventLog, Listener
from taichi_soft.events.witness import Witness

__all__ = [
    "ContactBegan",
    "ContactEnded",
    "Event",
    "EventLog",
    "FellAsleep",
    "Froze",
    "Listener",
    "StressExceeded",
    "TearCandidates",
    "Witness",
    "Woke",
]
