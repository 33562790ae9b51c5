"""Processor cores, and the threads that are bound to them: on Linux."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from pathlib import Path
from typing import Any

from taichi_soft.core.errors import DeviceError, OptionError

_TASKS = "/proc/self/task"


def available_cores() -> list[int]:
    """Numbers of the cores that this process may run on, ascending."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def can_bind() -> bool:
    """Whether threads can be told apart and bound to cores on this system."""
    return sys.platform.startswith("linux") and Path(_TASKS).is_dir()


def require_cores(cores: Any, there: list[int]) -> tuple[int, ...]:
    """Different ones of the cores that are `there`, in the order given. Raises: OptionError."""
    if not can_bind():
        raise OptionError(
            f"threads can be bound to cores on Linux with /proc only, not on {sys.platform}: leave cores out"
        )
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


def number_now() -> int:
    """The number of a thread that began just now: the system gives them in turn, and again from the first."""
    thread = threading.Thread(target=int)
    thread.start()
    thread.join()
    assert thread.native_id is not None
    return thread.native_id


def bind_youngest(threads: set[int], since: int, cores: tuple[int, ...]) -> None:
    """Bind the threads that were started last to a core each, to the first core the oldest of them.

    Args:
        threads: started after the one of number `since`.
    Raises: DeviceError where the system does not let us; then all are as they were.
    """
    masks: dict[int, set[int]] = {}
    try:
        numbers = int(Path("/proc/sys/kernel/pid_max").read_text())
        in_turn = sorted(threads, key=lambda thread: (thread - since) % numbers)
        for thread, core in zip(in_turn[-len(cores) :], cores, strict=True):
            mask = os.sched_getaffinity(thread)
            os.sched_setaffinity(thread, {core})
            masks[thread] = mask
    except (OSError, ValueError) as error:
        with contextlib.suppress(OSError):
            for thread, mask in masks.items():
                os.sched_setaffinity(thread, mask)
        raise DeviceError(f"cannot bind threads to cores {list(cores)}: {error}. Leave cores out") from error
