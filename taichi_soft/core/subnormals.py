"""Subnormal numbers: nothing to kernels, in whichever thread they run, and as they were to everybody else.

Taichi has the processor take numbers below 1e-38 for zero, in the thread that starts it and in its workers.
Elsewhere the same kernel would give other bits, and take 1.2 times as long where forces fade out.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

Environment = ctypes.c_char * 64
"""Room for C's `fenv_t`, how a thread computes with floats: 32 bytes at most where Taichi runs."""


def _unchanged(_: Any) -> None:
    """In place of C's functions, where the system's library has none."""


try:
    _c = ctypes.PyDLL("ucrtbase" if os.name == "nt" else None)
    _read, _write = _c.fegetenv, _c.fesetenv
except (AttributeError, OSError):
    _read = _write = _unchanged  # type: ignore[assignment]

_kernels = Environment()
"""How kernels compute: after `learn`. Before it as this thread does, as an empty one would trap."""
_read(_kernels)


def learn(start: Callable[[], None]) -> None:
    """Call what starts Taichi, note how it wants floats computed, and leave this thread as it was."""
    here = Environment()
    _read(here)
    try:
        start()
        _read(_kernels)
    finally:
        _write(here)


def without_subnormals(function: Function) -> Function:
    """Lets a function compute as kernels do, once Taichi is started."""

    @wraps(function)
    def call(*arguments: Any, **options: Any) -> Any:
        here = Environment()
        _read(here)
        try:
            _write(_kernels)
            return function(*arguments, **options)
        finally:
            _write(here)

    return cast("Function", call)
