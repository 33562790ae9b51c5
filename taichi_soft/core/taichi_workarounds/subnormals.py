"""Compute subnormal numbers as in IEEE 754, in the thread that calls a kernel and in Taichi's workers.

Taichi makes the processor flush numbers below 1e-38 to zero, in the thread that starts Taichi and in its
workers. WebAssembly cannot flush numbers to zero, and other libraries change the setting of their threads. A
kernel would therefore compute different bits in different threads and on different platforms.

This file is unnecessary once Taichi has an option for the setting.
https://github.com/taichi-dev/taichi/pull/2143 made the setting fixed. The main branch still has no option.
`with_usual_floats` around a kernel remains necessary because of other libraries.
"""

import ctypes
import os
import sys
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np

from taichi_soft.core.taichi_workarounds.importing import ti
from taichi_soft.core.taichi_workarounds.kernel_keys import not_kept

Function = TypeVar("Function", bound=Callable[..., Any])

Environment = ctypes.c_char * 64
"""Type of a buffer for C's `fenv_t`. On all platforms of Taichi, `fenv_t` has at most 32 bytes."""


def _unchanged(_: Any) -> None:
    """Do nothing. Replacement for a C function that the system's library lacks."""


try:
    _c = ctypes.PyDLL("ucrtbase" if os.name == "nt" else None)
    _read, _write = _c.fegetenv, _c.fesetenv
except (AttributeError, OSError):
    _read = _write = _unchanged  # type: ignore[assignment]


def _usual_environment() -> Any:
    """Return the default floating-point environment.

    On Linux, this is C's `FE_DFL_ENV`. Elsewhere, it is the environment of the thread that imports this file.
    """
    here, usual = Environment(), Environment()
    _read(here)
    if sys.platform == "linux":
        _write(ctypes.c_void_p(-1))
    _read(usual)
    _write(here)
    return usual


_usual = _usual_environment()


def with_usual_floats(function: Function) -> Function:
    """Decorate a function, so that it runs with IEEE 754 floats.

    After each call, the floating-point settings of the thread are restored.
    """

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


def give_workers_usual_floats(count: int) -> None:
    """Undo Taichi's floating-point setting in all `count` workers.

    A kernel runs a loop with one iteration per worker. Each iteration calls C's `fesetenv` and waits for the
    other iterations, so that no worker runs two iterations.
    """
    address = ctypes.cast(_write, ctypes.c_void_p).value if _write is not _unchanged else None
    if address is None:
        return

    set_environment = _calling(address)

    @ti.kernel  # type: ignore[untyped-decorator]
    def set_everywhere(environment: ti.i64, arrived: ti.types.ndarray(dtype=ti.i32, ndim=1)):  # type: ignore
        ti.loop_config(block_dim=1)
        for _ in range(count):
            set_environment(environment)
            ti.atomic_add(arrived[0], 1)
            while ti.atomic_max(arrived[0], -1) < count:
                pass

    with not_kept():  # the kernel contains the address of a function in this process
        set_everywhere(ctypes.addressof(_usual), np.zeros(1, np.int32))


def _calling(function: int) -> Callable[[Any], None]:
    """Return a function for kernels that calls the C function at address `function` with one argument."""

    def call(argument: Any) -> None:
        runtime = ti.lang.impl.get_runtime()
        place = ti._lib.core.DebugInfo(runtime.get_current_src_info())
        given, nothing = ti.lang.expr.make_expr_group([argument]), ti.lang.expr.make_expr_group([])
        builder = runtime.compiling_callable.ast_builder()
        builder.insert_external_func_call(function, "", "", "", given, nothing, place)

    setattr(call, "_is_wrapped_kernel", True)  # noqa: B010  # otherwise Taichi warns
    return call
