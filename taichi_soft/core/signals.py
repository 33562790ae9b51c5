"""Handling of signals on the command line: Ctrl-C, even during imports, and SIGTERM.

Importing the package does not change the signal handlers of a program.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

_QUICK: Any = import_module("_signal")
"""The C module that the module `signal` wraps. `signal` converts results to enumerations. This conversion
would slow down each step."""

INTERRUPTED, TERMINATED = 130, 143
"""Exit codes after Ctrl-C (SIGINT) and after SIGTERM: 128 plus the number of the signal, as in shells."""


def watch_imports() -> None:
    """Make Ctrl-C end the command line with one line of text during the imports (1 s to 2 s)."""
    name = sys.argv[0] if getattr(sys, "argv", None) else ""
    is_command = Path(name).stem == "taichi-soft" or (name == "-m" and "taichi_soft" in sys.orig_argv)
    is_ours = is_command and multiprocessing.parent_process() is None and _is_main_thread()
    if is_ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Context in which Ctrl-C raises KeyboardInterrupt and SIGTERM raises SystemExit.

    The program can therefore remove incomplete files before it ends.
    """
    if not _is_main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _leave)
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


class Whole:
    """Context that delays Ctrl-C until the context ends. It has no effect outside the main thread."""

    def __enter__(self) -> None:
        self._handler, self._is_asked = None, False
        if _is_main_thread() and _QUICK.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._handler = _QUICK.signal(signal.SIGINT, self._ask)

    def _ask(self, *_: Any) -> None:
        self._is_asked = True

    def __exit__(self, *_: object) -> None:
        if self._handler is not None:
            _QUICK.signal(signal.SIGINT, self._handler)
        if self._is_asked:
            raise KeyboardInterrupt


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _end(*_: Any) -> None:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


def _leave(*_: Any) -> None:
    sys.exit(TERMINATED)


watch_imports()
