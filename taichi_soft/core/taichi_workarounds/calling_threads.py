"""Call Taichi from any thread.

Taichi cannot compile in two threads at once, and lets one thread use a kernel that another thread is still
compiling. Taichi's binary asserts that fields are allocated in the thread that started Taichi. Here, each
kernel call and each access to a number of a field excludes other threads. A dedicated thread starts Taichi
and allocates fields, because a caller's thread may end soon.

This file is unnecessary once Taichi can be used from several threads:
https://github.com/taichi-dev/taichi/issues/2022 is open, and https://github.com/taichi-dev/taichi/issues/4542
reports the assertion. The main branch has both faults.
"""

import functools
import threading
from _thread import start_new_thread
from collections.abc import Callable
from concurrent.futures import Future
from importlib import import_module
from queue import SimpleQueue
from typing import Any, TypeVar

from taichi_soft.core.taichi_workarounds.importing import ti
from taichi_soft.core.taichi_workarounds.subnormals import with_usual_floats
from taichi_soft.core.threads import in_turn

Result = TypeVar("Result")

_jobs: SimpleQueue[Callable[[], object]] = SimpleQueue()  # jobs for the dedicated thread
_is_served = threading.Lock()
_home = 0  # identity of the dedicated thread


def let_threads_in(lay_out_now: Callable[[Callable[[bool], None], bool], None]) -> None:
    """Make threads wait, so that only one thread at a time calls kernels or accesses numbers of fields.

    Args:
        lay_out_now: replacement for Taichi's function that lays out fields. It receives Taichi's function and
            the argument of that function.
    """
    compiling, accessor = threading.local(), import_module("taichi.lang.field").SNodeHostAccessor
    ti.lang.impl.PyTaichi.inside_kernel = property(
        lambda _: getattr(compiling, "is_on", False), lambda _, is_on: setattr(compiling, "is_on", is_on)
    )
    ti.lang.kernel_impl.Kernel.__call__ = in_turn(with_usual_floats(ti.lang.kernel_impl.Kernel.__call__))
    make = accessor.__init__

    def make_in_turn(self: Any, snode: Any) -> None:
        make(self, snode)
        self.getter, self.setter = in_turn(self.getter), in_turn(self.setter)

    accessor.__init__ = make_in_turn  # accessors read a list of kernels that Taichi extends without the GIL
    lay_out = ti.lang.impl.PyTaichi.materialize_root_fb
    ti.lang.impl.PyTaichi.materialize_root_fb = staticmethod(functools.partial(lay_out_now, lay_out))


def must_go_home() -> bool:
    """True if fields must be laid out and this thread is not the dedicated thread."""
    root = ti.lang.impl._root_fb
    return not (root.finalized or root.empty) and threading.get_ident() != _home


def at_home(function: Callable[[], Result]) -> Result:
    """Call a function in the dedicated thread, and return its result.

    On Ctrl-C, wait until the function ends, because an interrupted layout would break all worlds.
    """
    found: Future[Result] = Future()

    def work() -> None:
        try:
            found.set_result(function())
        except BaseException as error:
            found.set_exception(error)

    if not _is_served.locked():
        start_new_thread(_serve, ())
    try:
        _jobs.put(work)
        return found.result()
    except KeyboardInterrupt:
        last = threading.Event()
        _jobs.put(last.set)
        last.wait()
        raise


def _serve() -> None:
    global _home
    if _is_served.acquire(blocking=False):  # only one thread serves, even if Ctrl-C caused a second start
        _home = threading.get_ident()
        while True:
            _jobs.get()()


def leave_home() -> None:
    """Forget the dedicated thread in a process that was forked before Taichi started.

    A fork does not copy threads.
    """
    global _is_served
    _is_served = threading.Lock()
