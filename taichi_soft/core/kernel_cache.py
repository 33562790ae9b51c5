"""The lock on the folder in which Taichi keeps compiled kernels for the next process.

Taichi 1.7 reads and writes the folder only while it holds a file there. It gives up after 0.2 s where another
process has that file. It then compiles every kernel, and keeps none. A process that is killed while it writes
leaves the file behind: from then on that is so at every start, and nobody is told.
"""

import contextlib
import os
import time
from pathlib import Path

LONGEST_HELD = 30.0
"""Of a lock that somebody still holds [s], also where clocks differ."""

LOCK = "ticache.lock"


def folder_of(default: str) -> Path:
    """Where Taichi keeps kernels: `default`, or what the environment names."""
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default)


def await_lock(default: str) -> None:
    """Wait until nobody else reads or writes the kernels kept. What a killed process left is removed.

    Args:
        default: the folder where the environment names no other.
    """
    lock = folder_of(default) / LOCK
    with contextlib.suppress(OSError):  # it is gone, or not ours to remove
        while abs(time.time() - lock.stat().st_mtime) < LONGEST_HELD:
            time.sleep(0.02)
        lock.unlink()
