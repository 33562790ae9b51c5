"""Log the compilation and loading of kernels, and show the progress of long compilations on a terminal.

The logger `taichi_soft.core.compilation` logs each kernel with its time at level DEBUG.
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
"""Total time of compiling and loading kernels after which the terminal shows the progress [s]. Loading the
kernels of a small world takes less time, so the terminal then shows nothing."""

PAUSE = 5.0
"""Time without kernels after which `Burst` resets its count and its total time [s]."""


def _show_on_terminal(text: str) -> None:
    """Replace the current line of the terminal by `text`. An empty text clears the line.

    If stderr is not a terminal, do nothing.
    """
    if sys.stderr is not None and sys.stderr.isatty():
        print(f"\r{text:<79}\r", end="", file=sys.stderr, flush=True)


class Burst:
    """Counter of kernels that are compiled or loaded in quick succession."""

    def __init__(self) -> None:
        self.show: Show = _show_on_terminal
        self.made, self.found = 0, 0  # numbers of compiled and of loaded kernels in this process
        self._count, self._seconds, self._last = 0, 0.0, 0.0

    def begin(self, name: str) -> float:
        """Record that a compilation starts. Returns: the current time [s]."""
        now = time.perf_counter()
        if now - self._last > PAUSE:
            self._count, self._seconds = 0, 0.0
        if self._seconds > PATIENCE:
            so_far = f"{self._count} kernels in {self._seconds:.0f} s"
            self.show(f"compiling {name} ({so_far}; later starts load them from the cache)")
        return now

    def end(self, name: str, start: float, is_found: bool) -> None:
        """Record the first run of a kernel.

        Args:
            name: name of the kernel.
            start: result of `begin` [s].
            is_found: True if the kernel was loaded from the cache, False if it was compiled.
        """
        self._last = time.perf_counter()
        took = self._last - start
        if self._seconds > PATIENCE:
            self.show("")
        self._count, self._seconds = self._count + 1, self._seconds + took
        self.made, self.found = self.made + (not is_found), self.found + is_found
        _log.debug("kernel %s took %.3f s, %s", name, took, "from the cache" if is_found else "compiled")


BURST = Burst()


@contextlib.contextmanager
def shown_by(show: Show) -> Iterator[None]:
    """Context in which `show` receives the progress lines instead of the terminal.

    An empty line clears the previous line.
    """
    before, BURST.show = BURST.show, show
    try:
        yield
    finally:
        BURST.show = before
