"""The lock on the folder in which Taichi stores compiled kernels for the next process.

Taichi reads and writes the folder only while it holds a lock file there. If another process holds it for more
than 0.2 s, Taichi compiles every kernel and stores none. A process that is killed while it writes leaves the
lock file behind: every later start then compiles everything, without a message.

Needless once Taichi waits for the lock, and uses one that the system releases when a process ends. Main
branch has the same lock (`taichi/util/lock.h`); https://github.com/taichi-dev/taichi/pull/6919 only tells
users to remove the file.
"""

import contextlib
import os
import time
from pathlib import Path

LONGEST_HELD = 30.0
"""Age [s] from which a lock counts as abandoned, even if clocks differ."""

LOCK = "ticache.lock"


def folder_of(default: str) -> Path:
    """Folder in which Taichi stores kernels: the one named by the environment, or `default`."""
    return Path(os.environ.get("TI_OFFLINE_CACHE_FILE_PATH") or default)


def await_lock(default: str) -> None:
    """Wait until no other process reads or writes the kernels. Remove the lock of a process that was killed.

    Args:
        default: folder to use if the environment names none.
    """
    lock = folder_of(default) / LOCK
    with contextlib.suppress(OSError):  # it is gone, or belongs to another user
        while abs(time.time() - lock.stat().st_mtime) < LONGEST_HELD:
            time.sleep(0.02)
        lock.unlink()
