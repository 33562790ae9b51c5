"""Times of two calls in turns: a machine that slows down for a while then slows both."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter


def seconds_of(call: Callable[[], object]) -> float:
    """What one call takes [s]."""
    start = perf_counter()
    call()
    return perf_counter() - start


def in_turns(
    one: Callable[[], object], other: Callable[[], object], repeats: int
) -> tuple[list[float], list[float]]:
    """Times of both [s], call by call, after one of each to warm up."""
    pairs = [(seconds_of(one), seconds_of(other)) for _ in range(repeats + 1)][1:]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]
