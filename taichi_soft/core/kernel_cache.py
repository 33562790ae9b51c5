"""Lock of the folder in which Taichi caches compiled kernels.

Taichi 1.7 reads and writes the folder only while it holds a lock file there. If another process holds it for
0.2 s, Taichi silently compiles every kernel and stores none. A process that is killed while writing leaves
the lock file behind, which disables the cache for all later starts.
"""

import contextlib
import os
import time
from pathlib import Path

LONGEST_HELD = 30.0
"""Largest age of a valid lock [s], including differences of clocks."""

LOCK = "ticache.lock"


def folder_of(default: str) -> Path:
    """Folder of Taichi's cache: from the environment, or `default`."""
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default)


def await_lock(default: str) -> None:
    """Wait until no other process uses the cache, and remove the lock of a killed process.

    Args:
        default: folder, unless the environment names another one.
    """
    lock = folder_of(default) / LOCK
    with contextlib.suppress(OSError):  # already removed, or not permitted
        while abs(time.time() - lock.stat().st_mtime) < LONGEST_HELD:
            time.sleep(0.02)
        lock.unlink()
