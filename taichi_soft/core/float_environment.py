"""How a thread computes with floats: as IEEE 754 says, in kernels.

Taichi has the processor take numbers below 1e-38 for zero, in the thread that starts it and in its workers.
WebAssembly cannot do that, and other libraries change it for threads of their own. A kernel would give other
bits from one place to the next.
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
"""Room for C's `fenv_t`: 32 bytes at most where Taichi runs."""


def _unchanged(_: Any) -> None:
    """In place of C's functions, where the system's library has none."""


try:
    _c = ctypes.PyDLL("ucrtbase" if os.name == "nt" else None)
    _read, _write = _c.fegetenv, _c.fesetenv
except (AttributeError, OSError):
    _read = _write = _unchanged  # type: ignore[assignment]


def _usual_environment() -> Any:
    """C's `FE_DFL_ENV`; where we do not know it, the environment of the thread that imports the package."""
    here, usual = Environment(), Environment()
    _read(here)
    if sys.platform == "linux":
        _write(ctypes.c_void_p(-1))
    _read(usual)
    _write(here)
    return usual


_usual = _usual_environment()


def usual_environment_call() -> tuple[int, int]:
    """Addresses of a C function that has its thread compute as usual, and of its argument; 0, 0 for none."""
    if _write is _unchanged:
        return 0, 0
    return ctypes.cast(_write, ctypes.c_void_p).value or 0, ctypes.addressof(_usual)


def with_usual_floats(function: Function) -> Function:
    """Lets a function compute as IEEE 754 says, and leaves its thread as it was."""

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
