"""List CPU cores, and bind threads to them on Linux."""

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
    """Return the numbers of the cores that this process can use, in ascending order."""
    if hasattr(os, "sched_getaffinity"):
        return sorted(os.sched_getaffinity(0))
    return list(range(os.cpu_count() or 1))


def can_bind() -> bool:
    """True if this system can identify threads and bind them to cores."""
    return sys.platform.startswith("linux") and Path(_TASKS).is_dir()


def require_cores(cores: Any, there: list[int]) -> tuple[int, ...]:
    """Check that `cores` are distinct numbers from `there`, and return them. Raises: OptionError."""
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
        raise OptionError(f"cores must be distinct numbers from {there}, got {cores!r}")
    return found


def thread_ids() -> set[int]:
    """Return the system's ids of the threads of this process."""
    return {int(name) for name in os.listdir(_TASKS)}


def number_now() -> int:
    """Start and end a thread, and return its id. The system assigns ids in ascending order, and continues
    with small ids after the largest id.
    """
    thread = threading.Thread(target=int)
    thread.start()
    thread.join()
    assert thread.native_id is not None
    return thread.native_id


def bind_youngest(threads: set[int], since: int, cores: tuple[int, ...]) -> None:
    """Bind the last `len(cores)` threads that started to one core each, in the order in which they started.

    Args:
        threads: ids of threads that started after the thread `since`.
        since: id of an earlier thread, see `number_now`.
        cores: one core for each thread to bind.
    Raises: DeviceError if the system refuses. The function then restores all bindings.
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
