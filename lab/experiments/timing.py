"""Time two calls in alternation, so that a slow phase of the machine affects both."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter


def seconds_of(call: Callable[[], object]) -> float:
    """Return the duration of a call [s]."""
    start = perf_counter()
    call()
    return perf_counter() - start


def in_turns(
    one: Callable[[], object], other: Callable[[], object], repeats: int
) -> tuple[list[float], list[float]]:
    """Call both functions in alternation, after one call of each to warm up.

    Returns: durations of the calls of `one` and of `other`, `repeats` each [s].
    """
    pairs = [(seconds_of(one), seconds_of(other)) for _ in range(repeats + 1)][1:]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]
