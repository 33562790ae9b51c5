"""Hidden temporary folder for incomplete files, next to the path of the final file."""

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
    """A new temporary folder in `parent`. The constructor first removes the folders of ended processes.

    A process locks a file in its folder. The system releases the lock when the process ends, even if the
    process is killed. A folder whose lock is free is therefore abandoned.
    Raises: OSError if the folder cannot be created.
    """

    def __init__(self, parent: Path) -> None:
        remove_abandoned(parent)
        self.path = Path(tempfile.mkdtemp(prefix=PREFIX, dir=parent))
        self._remove = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)
        # Rename the lock file only after locking it, so that no other process finds the lock free.
        self._lock = (self.path / "new").open("wb")
        _try_lock(self._lock)
        if sys.platform != "win32":
            (self.path / "new").rename(self.path / LOCK)

    def remove(self) -> None:
        """Remove the folder and its contents. Later calls do nothing."""
        self._lock.close()
        self._remove()


def remove_abandoned(parent: Path) -> None:
    """Remove the temporary folders in `parent` whose processes have ended."""
    for folder in parent.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError):  # the folder is already removed, in use, or protected
            if _is_abandoned(folder):
                shutil.rmtree(folder)


def _is_abandoned(folder: Path) -> bool:
    """True if no process holds the lock of a folder. Raises: OSError if this cannot be determined."""
    if sys.platform == "win32":
        (folder / "new").unlink()  # fails while the file is open
        return True
    with (folder / LOCK).open("r+b") as lock:
        return _try_lock(lock)


def _try_lock(lock: IO[bytes]) -> bool:
    """Lock a file until it is closed. Returns: False if another process holds the lock."""
    if sys.platform != "win32":
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
    return True
