"""Clock of a world."""

from dataclasses import dataclass


@dataclass
class Clock:
    """Number of fixed steps that a world has made, and their simulated time."""

    steps: int = 0
    time: float = 0.0  # simulated time [s]
    last_dt: float = 0.0  # length of the last fixed step [s], 0 before the first step
