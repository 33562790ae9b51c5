"""How far a world has come."""

from dataclasses import dataclass


@dataclass
class Clock:
    """Of one world: its fixed steps so far, and the time that they took."""

    steps: int = 0
    time: float = 0.0  # simulated [s]
    last_dt: float = 0.0  # length of the last fixed step [s], 0 before the first
