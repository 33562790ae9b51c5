"""Wait for the lock on the folder in which Taichi stores compiled kernels for later processes.

Taichi reads and writes the folder only while it holds a lock file there. If another process holds the lock
for more than 0.2 s, Taichi compiles every kernel and stores none. A process that is killed while it writes
leaves the lock file behind. Every later start then compiles everything, without a message.

This file is unnecessary once Taichi waits for the lock, and uses a lock that the system releases when a
process ends. The main branch has the same lock (`taichi/util/lock.h`);
https://github.com/taichi-dev/taichi/pull/6919 only tells users to remove the file.
"""

import contextlib
import os
import time
from pathlib import Path

LONGEST_HELD = 30.0
"""Age of a lock file from which the lock counts as abandoned [s]. The value allows for clocks that differ by
a few seconds."""

LOCK = "ticache.lock"


def folder_of(default: str) -> Path:
    """Return the folder in which Taichi stores kernels: the folder that an environment variable names, or
    `default`.
    """
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default)


def await_lock(default: str) -> None:
    """Wait until no other process reads or writes the kernels. Remove the lock of a process that was killed.

    Args:
        default: folder to use if the environment names no folder.
    """
    lock = folder_of(default) / LOCK
    with contextlib.suppress(OSError):  # raised if the lock no longer exists, or belongs to another user
        while abs(time.time() - lock.stat().st_mtime) < LONGEST_HELD:
            time.sleep(0.02)
        lock.unlink()
