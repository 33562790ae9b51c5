"""Make the keys of Taichi's disk cache equal on all machines, and different in each version of the package.

Taichi compiles the machine's number of threads into each parallel loop, and adds this number to the key.
Another machine would not find the kernel, or would run the kernel on too few threads.

This file is unnecessary once Taichi reads the number of threads when a loop starts, and accepts a part of the
key from its caller. The main branch does neither. We know of no issue about this.
"""

import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from taichi_soft.core.taichi_workarounds.importing import ti

_MOST_THREADS = 1 << 20
"""Number of threads that is compiled into each loop. It is larger than the number of threads of any
machine."""


def let_any_number_of_threads_run() -> None:
    """Compile `_MOST_THREADS` into each loop. Taichi then uses all threads that it has started."""
    builder, given = ti._lib.core.ASTBuilder, threading.local()
    parallelize = builder.parallelize

    def give(self: Any, threads: int) -> None:  # `threads` is 1 if the next loop is serial
        given.within = ti.lang.impl.get_runtime().compiling_callable
        parallelize(self, threads)

    def opening(begin: Callable[..., Any]) -> Callable[..., Any]:
        def begin_loop(self: Any, *arguments: Any) -> Any:
            # The bounds of a loop can call a real function. Taichi then compiles the loops of that function
            # first.
            if getattr(given, "within", None) is ti.lang.impl.get_runtime().compiling_callable:
                given.within = None
            else:
                parallelize(self, _MOST_THREADS)
            return begin(self, *arguments)

        return begin_loop

    builder.parallelize = give
    for kind in ("range_for", "struct_for_on_snode", "struct_for_on_external_tensor"):
        name = f"begin_frontend_{kind}"
        setattr(builder, name, opening(getattr(builder, name)))


def keep_kernels_apart(version: str) -> None:
    """Make the keys different in each version of the package. Call this after Taichi has started.

    The number of threads in the key is replaced by a number that depends on the version. This number is
    larger than the number of threads of any machine.
    """
    ti.lang.impl.current_cfg().cpu_max_num_threads = (
        _MOST_THREADS + zlib.crc32(version.encode()) % _MOST_THREADS
    )


def code_options() -> str:
    """Return all options of the running Taichi that change code, with their values, as text."""
    config = ti.lang.impl.current_cfg()
    names = [name for name in dir(config) if not name.startswith(("_", "offline_cache", "print_", "verbose"))]
    numbers = {name: getattr(config, name) for name in names if name != "num_compile_threads"}
    return str({name: value for name, value in numbers.items() if isinstance(value, (bool, int, float))})


@contextmanager
def not_kept() -> Iterator[None]:
    """Context in which compiled kernels are not stored in Taichi's cache."""
    config = ti.lang.impl.current_cfg()
    usual, config.offline_cache = config.offline_cache, False
    try:
        yield
    finally:
        config.offline_cache = usual
