"""Processor cores, and the threads that are bound to them: on Linux."""

from __future__ import annotations

import os
import sys
from typing import Any

from taichi_soft.errors import OptionError

_TASKS = "/proc/self/task"


def available_cores() -> list[int]:
    """Numbers of the cores that this process may run on, ascending."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def require_cores(cores: Any) -> tuple[int, ...]:
    """Different cores that threads can be bound to, in the order given. Raises: OptionError."""
    if not sys.platform.startswith("linux"):
        raise OptionError(
            f"threads can be bound to cores on Linux only, not on {sys.platform}: leave cores out"
        )
    there = available_cores()
    try:
        found = tuple(cores)
    except TypeError:
        found = ()
    is_known = all(type(core) is int and core in there for core in found)
    if isinstance(cores, str) or not found or not is_known or len(set(found)) < len(found):
        raise OptionError(f"cores must be different ones of {there}, got {cores!r}")
    return found


def thread_ids() -> set[int]:
    """The system's numbers of the threads of this process."""
    return {int(name) for name in os.listdir(_TASKS)}


def bind_youngest(threads: set[int], cores: tuple[int, ...]) -> None:
    """Bind the threads that were started last to a core each, to the first core the oldest of them."""
    for thread, core in zip(sorted(threads)[-len(cores) :], cores, strict=True):
        os.sched_setaffinity(thread, {core})
