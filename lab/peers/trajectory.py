"""Record the motion of a body in a drop, and the computing time of its engine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import Drop
from lab.peers.silence import silenced
from taichi_soft.core.errors import StateError

Floats = NDArray[np.float64]
Progress = Callable[[int, int], None]

RATE = 120
"""Rate at which positions are recorded [1/s]. Two records per frame resolve the deepest squash."""

FRAME = 1 / 60
"""Simulated time per frame [s]. The reported cost is the computing time of one frame."""

FARTHEST = 3.0
"""A body counts as exploded if a coordinate exceeds this multiple of the largest initial coordinate."""

MOST_HALVINGS = 6
"""Number of times that a step is halved before an engine counts as failed."""


@dataclass(frozen=True)
class Trajectory:
    """Positions of the vertices over time, and the computing time of each frame."""

    positions: Floats  # positions from the start on, 1 / RATE s apart, (k, n, 3) [m]
    frame_times: Floats  # computing time of each FRAME [s]
    step: float  # step of the engine [s]

    def at(self, time: float) -> Floats:
        """Return the positions of the vertices at a time [s], (n, 3) [m].

        Positions between records are interpolated linearly. After the end, the last positions are returned.
        """
        place = min(max(time * RATE, 0.0), len(self.positions) - 1.0)
        before = min(int(place), len(self.positions) - 2)
        share = place - before
        between: Floats = (1.0 - share) * self.positions[before] + share * self.positions[before + 1]
        return between


@dataclass(frozen=True)
class Simulation:
    """A body in an engine at the start of the drop."""

    advance: Callable[[], None]  # advances the engine by 1 / RATE s
    positions: Callable[[], Floats]  # returns the current positions, (n, 3) [m]
    step: float  # step of the engine [s]


def record(
    drop: Drop, make: Callable[[int], Simulation], first: int, on_frame: Progress | None = None
) -> Trajectory:
    """Simulate a drop with the longest step at which the body stays intact.

    Args:
        make: function that creates an engine's simulation with a number of steps per 1 / RATE s.
        first: number of steps per 1 / RATE s that the engine's authors recommend. The number is doubled after
            each explosion.
        on_frame: called with (frames done, total frames) after each frame.
    Raises: StateError if no step is stable.
    """
    for doubling in range(MOST_HALVINGS + 1):
        steps = first << doubling
        with silenced():
            engine = make(steps)
        trajectory = _try(drop, engine, on_frame)
        if trajectory is not None:
            return trajectory
    raise StateError(f"the body explodes even with {first << MOST_HALVINGS} steps in 1/{RATE} s")


def _try(drop: Drop, engine: Simulation, on_frame: Progress | None) -> Trajectory | None:
    """Return the trajectory of the drop; None if the body explodes."""
    frames = round(drop.seconds / FRAME)
    positions, times = [np.array(engine.positions(), dtype=np.float64)], []
    reach = FARTHEST * np.abs(drop.start).max()
    for frame in range(frames):
        took = 0.0
        for _ in range(round(FRAME * RATE)):
            start = perf_counter()
            engine.advance()
            took += perf_counter() - start
            positions.append(np.array(engine.positions(), dtype=np.float64))
            if not np.abs(positions[-1]).max() < reach:  # also catches NaN
                return None
        times.append(took)
        if on_frame:
            on_frame(frame + 1, frames)
    return Trajectory(np.array(positions), np.array(times), engine.step)
