"""The way of a body through a drop, and what its engine took for that."""

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
"""Positions are noted so often [1/s]: twice a frame, for the moment of deepest squash."""

FRAME = 1 / 60
"""What the cost is told of [s]."""

FARTHEST = 3.0
"""A body whose vertices are farther off than so many heights of its start has exploded."""

MOST_HALVINGS = 6
"""Of a step, before an engine is given up."""


@dataclass(frozen=True)
class Course:
    """Where the vertices were, and how long each frame took."""

    positions: Floats  # (k, n, 3), each 1 / RATE s from the start on [m]
    frame_times: Floats  # of stepping each FRAME [s]
    step: float  # of the engine [s]

    def at(self, time: float) -> Floats:
        """The vertices at a time [s], (n, 3), between the positions noted; at the end they stay."""
        place = min(max(time * RATE, 0.0), len(self.positions) - 1.0)
        before = min(int(place), len(self.positions) - 2)
        share = place - before
        between: Floats = (1.0 - share) * self.positions[before] + share * self.positions[before + 1]
        return between


@dataclass(frozen=True)
class Simulation:
    """A body in an engine, at its start."""

    advance: Callable[[], None]  # by 1 / RATE s
    positions: Callable[[], Floats]  # (n, 3) [m]
    step: float  # [s]


def record(
    drop: Drop, make: Callable[[int], Simulation], first: int, on_frame: Progress | None = None
) -> Course:
    """The course of a drop with the longest step that holds.

    Args:
        make: an engine that takes so many steps in 1 / RATE s.
        first: as many as its makers advise. They are doubled until the body holds together.
        on_frame: called with (frames made, frames in all).
    Raises: StateError where no step holds.
    """
    for doubling in range(MOST_HALVINGS + 1):
        steps = first << doubling
        with silenced():
            engine = make(steps)
        course = _try(drop, engine, on_frame)
        if course is not None:
            return course
    raise StateError(f"the body explodes even with {first << MOST_HALVINGS} steps in 1/{RATE} s")


def _try(drop: Drop, engine: Simulation, on_frame: Progress | None) -> Course | None:
    """A whole course; None where the body flies apart."""
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
            if not np.abs(positions[-1]).max() < reach:  # written so that NaN is caught too
                return None
        times.append(took)
        if on_frame:
            on_frame(frame + 1, frames)
    return Course(np.array(positions), np.array(times), engine.step)
