"""Summarise repeated measurements."""

from __future__ import annotations

from collections.abc import Callable
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
        """Summarise `values`, which must not be empty."""
        rows = np.asarray(values)
        return cls(
            float(rows.min()), float(np.median(rows)), float(np.percentile(rows, 99)), float(rows.max())
        )

    def scaled(self, factor: float) -> Spread:
        """Return all four numbers multiplied by `factor`, for example to convert the unit."""
        return Spread(self.least * factor, self.median * factor, self.p99 * factor, self.most * factor)


def time_calls(call: Callable[[], object], repeats: int) -> list[float]:
    """Call a function `repeats` times and return the time of each call [s]."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        call()
        times.append(perf_counter() - start)
    return times


def compare(
    one: Callable[[], object], other: Callable[[], object], repeats: int, unit: float
) -> tuple[Spread, Spread, Spread]:
    """Time two calls alternately, after two warm-up rounds.

    A temporary slowdown of the machine then affects both calls, so that their ratio stays valid.
    Returns: times of `one` and times of `other`, in seconds times `unit`, and their ratio, `one` divided by
        `other`, for each pair of calls.
    """
    pairs = [(time_calls(one, 1)[0], time_calls(other, 1)[0]) for _ in range(repeats + 2)][2:]
    ones, others = ([pair[i] for pair in pairs] for i in (0, 1))
    return Spread.of(ones).scaled(unit), Spread.of(others).scaled(unit), Spread.of([a / b for a, b in pairs])
