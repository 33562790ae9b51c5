"""Where a file is made until it is complete: a hidden folder beside its place."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
import weakref
from pathlib import Path
from typing import IO

if sys.platform != "win32":
    import fcntl

PREFIX, LOCK = ".taichi-soft-part-", "lock"


class PartFolder:
    """A new folder in `parent`. What processes that have died left there is removed first.

    A process holds a lock on a file in its folder. The system gives it back when the process ends, also where
    that was killed: a folder whose lock can be taken belongs to nobody.
    Raises: OSError where there can be none.
    """

    def __init__(self, parent: Path) -> None:
        remove_abandoned(parent)
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        self._remove = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)
        # The lock gets its name once it is held, so that no other process finds it free.
        self._lock = (self.path / "new").open("wb")
        _try_lock(self._lock)
        if sys.platform != "win32":
            (self.path / "new").rename(self.path / LOCK)

    def remove(self) -> None:
        """Remove it with all that is in it; once removed, does nothing."""
        self._lock.close()
        self._remove()


def remove_abandoned(parent: Path) -> None:
    """Remove what processes that have ended left in `parent`."""
    for folder in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # it is gone, in use, or not ours
            if _is_abandoned(folder):
                shutil.rmtree(folder)


def _is_abandoned(folder: Path) -> bool:
    """Raises: OSError where it cannot be told."""
    if sys.platform == "win32":
        (folder / "new").unlink()  # refused while it is open
        return True
    with (folder / LOCK).open("r+b") as lock:
        return _try_lock(lock)


def _try_lock(lock: IO[bytes]) -> bool:
    """Take it until the file is closed, if nobody has it."""
    if sys.platform != "win32":
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
