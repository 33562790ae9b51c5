"""The lock on the folder in which Taichi keeps compiled kernels for the next process.

Taichi reads and writes the folder only while it holds a file there. It gives up after 0.2 s where another
process has that file. It then compiles every kernel, and keeps none. A process that is killed while it writes
leaves the file behind: from then on every start compiles everything, without a message.

Needless once Taichi waits for the lock, and uses one that the system releases when a process ends. Main
branch has the same lock (`taichi/util/lock.h`); https://github.com/taichi-dev/taichi/pull/6919 only tells
people to remove the file.
"""

import contextlib
import os
import time
from pathlib import Path

LONGEST_HELD = 30.0
"""Age [s] from which a lock counts as left behind, also where clocks differ."""

LOCK = "ticache.lock"


def folder_of(default: str) -> Path:
    """Folder in which Taichi keeps kernels: `default`, or what the environment names."""
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default)


def await_lock(default: str) -> None:
    """Wait until no other process reads or writes the kernels. Remove a lock that a killed process left.

    Args:
        default: the folder where the environment names no other.
    """
    lock = folder_of(default) / LOCK
    with contextlib.suppress(OSError):  # it is gone, or not ours to remove
        while abs(time.time() - lock.stat().st_mtime) < LONGEST_HELD:
            time.sleep(0.02)
        lock.unlink()
