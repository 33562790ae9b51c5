"""Repeated times of one thing, in one number for each question."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np


@dataclass(frozen=True)
class Spread:
    """Minimum, median, 99th percentile and maximum of repeated measurements."""

    least: float
    median: float
    p99: float
    most: float

    @classmethod
    def of(cls, values: list[float]) -> Spread:
        """Summarise at least one value."""
        rows = np.asarray(values)
        return cls(
            float(rows.min()), float(np.median(rows)), float(np.percentile(rows, 99)), float(rows.max())
        )

    def scaled(self, factor: float) -> Spread:
        """The same in another unit."""
        return Spread(self.least * factor, self.median * factor, self.p99 * factor, self.most * factor)


def time_calls(call: Callable[[], object], repeats: int) -> list[float]:
    """What each of `repeats` calls takes [s]."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return times


def time_in_turns(calls: Sequence[Callable[[], object]], repeats: int) -> list[list[float]]:
    """As `time_calls` for several calls, one after the other in every round.

    A machine that slows down for a while then slows all of them, and their ratio holds.
    """
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for row, call in zip(times, calls, strict=True):
            row.extend(time_calls(call, 1))
    return times
