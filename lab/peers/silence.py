"""Discard the output of engines written in C. This output does not pass through Python's streams."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def silenced() -> Iterator[None]:
    """Return a context in which all output of the process is discarded."""
    c = ctypes.CDLL(None if os.name == "posix" else "ucrtbase")
    sys.stdout.flush()
    sys.stderr.flush()
    kept = {number: os.dup(number) for number in (1, 2)}
    try:
        with open(os.devnull, "wb") as nowhere:
            for number in kept:
                os.dup2(nowhere.fileno(), number)
        yield
    finally:
        c.fflush(None)
        for number, copy in kept.items():
            os.dup2(copy, number)
            os.close(copy)
