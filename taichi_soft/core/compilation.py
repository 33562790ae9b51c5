"""Kernels as they are compiled, or loaded from a cache: logged, and shown on a terminal where it takes long.

Each is logged by `taichi_soft.core.compilation` with its time, at level DEBUG.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import time
from collections.abc import Callable, Iterator

Show = Callable[[str], object]

_log = logging.getLogger(__name__)

PATIENCE = 1.0
"""Time in kernels [s] after which a terminal is told. Loading what a small world needs takes less."""

PAUSE = 5.0
"""Time without a new kernel [s] after which counting begins anew."""


def _show_on_terminal(text: str) -> None:
    """Write a line anew on the terminal that there may be; an empty one clears it."""
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"\r{text:<79}\r", end="", file=sys.stderr, flush=True)


class Burst:
    """Kernels that follow each other."""

    def __init__(self) -> None:
        self.show: Show = _show_on_terminal
        self.made, self.found = 0, 0  # since the start of the process
        self._count, self._seconds, self._last = 0, 0.0, 0.0

    def begin(self, name: str) -> float:
        """A kernel is going to be compiled. Returns: now [s]."""
        now = time.perf_counter()
        if now - self._last > PAUSE:
            self._count, self._seconds = 0, 0.0
        if self._seconds > PATIENCE:
            so_far = f"{self._count} kernels in {self._seconds:.0f} s"
            self.show(f"compiling {name} ({so_far}; a later start finds them in a cache)")
        return now

    def end(self, name: str, start: float, is_found: bool) -> None:
        """It has run for the first time, `is_found` among those known or made from its source."""
        self._last = time.perf_counter()
        took = self._last - start
        if self._seconds > PATIENCE:
            self.show("")
        self._count, self._seconds = self._count + 1, self._seconds + took
        self.made, self.found = self.made + (not is_found), self.found + is_found
        _log.debug("kernel %s took %.3f s, %s", name, took, "known" if is_found else "made from its source")


BURST = Burst()


@contextlib.contextmanager
def shown_by(show: Show) -> Iterator[None]:
    """While this lasts, `show` gets the lines instead of the terminal; an empty one clears the last."""
    before, BURST.show = BURST.show, show
    try:
        yield
    finally:
        BURST.show = before
