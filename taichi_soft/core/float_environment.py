"""Floating-point environment of threads: kernels follow IEEE 754.

Taichi turns on flush-to-zero in the thread that starts it and in its workers. WebAssembly does not support
that, and other libraries change it in their threads. Then a kernel's bits would depend on where it runs.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

Environment = ctypes.c_char * 64
"""Buffer for C's `fenv_t`, which has at most 32 bytes on Taichi's platforms."""


def _unchanged(_: Any) -> None:
    """Replacement if the system's library lacks C's functions."""


try:
    _c = ctypes.PyDLL("ucrtbase" if os.name == "nt" else None)
    _read, _write = _c.fegetenv, _c.fesetenv
except (AttributeError, OSError):
    _read = _write = _unchanged  # type: ignore[assignment]


def _usual_environment() -> Any:
    """C's `FE_DFL_ENV`, or if unknown, the environment of the importing thread."""
    here, usual = Environment(), Environment()
    _read(here)
    if sys.platform == "linux":
        _write(ctypes.c_void_p(-1))
    _read(usual)
    _write(here)
    return usual


_usual = _usual_environment()


def usual_environment_call() -> tuple[int, int]:
    """Addresses of a C function that restores the default environment, and of its argument; 0, 0 for none."""
    if _write is _unchanged:
        return 0, 0
    return ctypes.cast(_write, ctypes.c_void_p).value or 0, ctypes.addressof(_usual)


def with_usual_floats(function: Function) -> Function:
    """Decorate a function to run with IEEE 754 floats, and restore the thread's environment after it."""

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        here = Environment()
        _read(here)
        try:
            _write(_usual)
            return function(*arguments, **options)
        finally:
            _write(here)

    return cast("Function", call)
