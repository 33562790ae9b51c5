"""Start Taichi once.

Every other module imports `ti` from here, after the workarounds of `taichi_soft.core.taichi_workarounds` have
been applied. Only this module calls `ti.init`, which resets every field in the process.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import io
import logging
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from taichi_soft.core.cores import (
    available_cores,
    bind_youngest,
    can_bind,
    number_now,
    require_cores,
    thread_ids,
)
from taichi_soft.core.errors import DeviceError, OptionError
from taichi_soft.core.taichi_workarounds.cache_lock import await_lock, folder_of
from taichi_soft.core.taichi_workarounds.calling_threads import (
    at_home,
    leave_home,
    let_threads_in,
    must_go_home,
)
from taichi_soft.core.taichi_workarounds.field_holders import holds_fields
from taichi_soft.core.taichi_workarounds.importing import ti
from taichi_soft.core.taichi_workarounds.index_checks import check_real_functions, let_whole_numbers_overflow
from taichi_soft.core.taichi_workarounds.kernel_keys import (
    code_options,
    keep_kernels_apart,
    let_any_number_of_threads_run,
)
from taichi_soft.core.taichi_workarounds.known_kernels import FIRST_LAUNCHES, KnownKernels
from taichi_soft.core.taichi_workarounds.min_max import choose_by_comparison
from taichi_soft.core.taichi_workarounds.real_functions import keep_branches_in_real_functions
from taichi_soft.core.taichi_workarounds.source_reading import read_sources_once
from taichi_soft.core.taichi_workarounds.subnormals import give_workers_usual_floats, with_usual_floats
from taichi_soft.core.threads import in_turn, leave_behind
from taichi_soft.core.types import ArchName
from taichi_soft.core.version import VERSION

__all__ = [
    "Device",
    "device",
    "export_kernels",
    "holds_fields",
    "init",
    "is_initialized",
    "kernel_folder",
    "make_fields",
    "ti",
    "with_usual_floats",
]

Result = TypeVar("Result")

DEBUG = "TAICHI_SOFT_DEBUG"
"""Name of the environment variable that turns on index checks in kernels if its value is 1. The checks are
slow, so use them only in tests."""

_MOST_THREADS = 256
_ARCHS = ("cpu", "cuda", "vulkan", "metal")


@dataclass(frozen=True)
class Device:
    """Device chosen by `init`."""

    arch: ArchName  # "cpu", "cuda", "vulkan" or "metal"
    threads: int  # number of CPU worker threads; 1 on a GPU, because the host code is serial there
    reason: str  # reason for choosing this device, in one line
    cores: tuple[int, ...] = ()  # core of each worker thread; () if the threads are not bound

    @property
    def is_gpu(self) -> bool:
        """True if kernels run on a graphics processor."""
        return self.arch != "cpu"


_log = logging.getLogger(__name__)

_device: Device | None = None
_process = 0  # id of the process that started Taichi
_checked_kernels: str | None = None  # folder of compiled kernels if index checks are on
_first_field: Any = None  # a field for the first layout: Taichi cannot export an empty layout


@in_turn
def init(arch: ArchName = "auto", threads: int | None = None, cores: Sequence[int] | None = None) -> Device:
    """Start Taichi for this process.

    `World.build` and other functions that need Taichi call this function. To choose the arguments, call it
    before these functions, from any thread. A process that is forked after the start of Taichi cannot use
    Taichi: start processes with "spawn". A second call with compatible arguments does nothing, because a
    restart would destroy the fields of every world. With TAICHI_SOFT_DEBUG=1 in the environment, kernels
    check every index.
    Args:
        arch: "auto" or "cpu", or a GPU: "cuda", "vulkan" or "metal". "auto" uses the CPU, which is faster for
            typical games (docs/speed.md) and leaves the GPU for rendering. "vulkan" and "metal" are untested.
        threads: number of unbound CPU worker threads, 1 or more, limited to the number of available cores.
            The system can move the threads between cores and put two threads on one core, so short frames can
            gain little from them.
        cores: numbers of CPU cores, on Linux only. Each core gets one worker thread, bound to the core.
            Choose cores that the rest of the game does not use, and call this function before other code
            starts threads. By default, each available core gets one thread. On Linux, this thread is bound to
            the core if the system permits.
    Returns: the device in use.
    Raises: OptionError for an invalid arch, thread count or core, or if Taichi already runs with other
        arguments; DeviceError if the device is not available, or threads cannot be bound; StateError in a
        process that was forked after the start of Taichi.
    """
    if not isinstance(arch, str) or arch not in ("auto", *_ARCHS):
        raise OptionError(f"unknown arch {arch!r}: choose one of 'auto', {', '.join(map(repr, _ARCHS))}")
    if threads is not None and (
        isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= _MOST_THREADS
    ):
        raise OptionError(
            f"threads must be None or a whole number from 1 to {_MOST_THREADS}, got {threads!r}"
        )
    there = available_cores()
    taken = (
        () if _device is None else _device.cores
    )  # these cores stay valid if the caller moves its own threads to other cores
    bound = () if cores is None else require_cores(cores, sorted({*there, *taken}))
    if bound and (arch not in ("auto", "cpu") or threads not in (None, len(bound))):
        raise OptionError(
            f"cores {list(bound)} are for {len(bound)} CPU threads, got arch={arch!r}, threads={threads}: "
            "leave out one or the other"
        )
    # Taichi starts at most one thread per core. With a larger count, the flat schedule would wait for threads
    # that never start.
    count = len(bound) or min(threads or len(there), len(there))
    if _device is not None:
        if arch not in ("auto", _device.arch):
            raise OptionError(
                f"Taichi already runs on {_device.arch!r}: call init({arch!r}) first in the process"
            )
        if threads is not None and _device.arch == "cpu" and count != _device.threads:
            raise OptionError(
                f"Taichi already runs with {_device.threads} threads: call init(threads={threads}) first"
            )
        if bound not in ((), _device.cores):
            where = f"on cores {list(_device.cores)}" if _device.cores else "on any core"
            raise OptionError(f"Taichi already runs {where}: call init(cores={list(bound)}) first")
        return _device

    chosen: ArchName = "cpu" if arch == "auto" else arch
    reason = "the default" if arch == "auto" else "requested"
    if ti.lang.impl.get_runtime().prog is not None:
        raise DeviceError(
            "Taichi was started by ti.init, and a restart would destroy its fields: call taichi_soft.init() "
            "instead, first in the process"
        )
    is_left_to_us = threads is None and cores is None and chosen == "cpu" and count > 1 and can_bind()
    wanted = tuple(there) if is_left_to_us else bound
    try:
        start = functools.partial(_start, chosen, reason, count, wanted, is_left_to_us)
        _at_home(with_usual_floats(start), chosen)
    except RuntimeError as error:
        if isinstance(error, DeviceError):
            raise
        raise DeviceError(f"cannot start Taichi on {chosen!r}: {error}. Use init('cpu')") from error
    found = device()
    if not found.is_gpu:
        give_workers_usual_floats(found.threads)
    where = f", bound to cores {list(found.cores)}" if found.cores else ""
    _log.info("Taichi runs on %s with %d threads%s (%s)", found.arch, found.threads, where, found.reason)
    return found


def _start(arch: ArchName, reason: str, threads: int, cores: tuple[int, ...], is_left_to_us: bool) -> None:
    """Start Taichi, bind its workers to `cores` if there are any, and store the device in `_device`."""
    global _device, _process, _checked_kernels, _first_field
    is_checked = os.environ.get(DEBUG) == "1"
    before, since = (thread_ids(), number_now()) if cores else (set(), 0)
    options = {}
    if is_checked:
        # Index checks need a separate cache, because the cache key ignores the options for them. Without a
        # cache, Taichi 1.7 confuses kernels that differ only in the instance of a real function they call.
        options["offline_cache_file_path"] = _checked_kernels = tempfile.mkdtemp()
    else:
        await_lock(ti.lang.impl.default_cfg().offline_cache_file_path)
    with contextlib.redirect_stdout(io.StringIO()):  # suppress Taichi's banner
        ti.init(
            arch=getattr(ti, arch),
            cpu_max_num_threads=threads,
            default_fp=ti.f32,
            default_ip=ti.i32,
            fast_math=False,  # fast math would make the last bits depend on the processor
            debug=is_checked,
            offline_cache=True,
            offline_cache_max_size_of_files=1
            << 29,  # the default of 100 MB is too small for a game with many kinds of worlds
            enable_fallback=False,
            cfg_optimization=False,  # if on, compilation takes twice as long and kernels are no faster
            detect_read_only=False,  # if on, kernels on a GPU might not see writes of real functions
            make_cpu_multithreading_loop=False,  # if on, one thread would run up to 512 bodies
            unrolling_limit=0,  # turns off a warning
            log_level=ti.ERROR,
            **options,
        )
    if is_checked:
        check_real_functions()
        let_whole_numbers_overflow()
    has_known = arch == "cpu" and not is_checked
    if has_known:
        FIRST_LAUNCHES.make_flag()
    _first_field = ti.field(ti.i32, ())
    ti.lang.impl.get_runtime().materialize()  # otherwise, the first kernel call would do this in any thread
    if has_known:
        keep_kernels_apart(VERSION)
        FIRST_LAUNCHES.open(KnownKernels(kernel_folder(), code_options()))
    _process = os.getpid()
    atexit.register(_end)
    _device = Device(arch=arch, threads=threads if arch == "cpu" else 1, reason=reason)
    if cores:
        _device = _bound(_device, thread_ids() - before, since, cores, is_left_to_us)


def kernel_folder() -> Path:
    """Return the folder in which this process, when it ends, stores compiled kernels for later processes."""
    return folder_of(ti.lang.impl.current_cfg().offline_cache_file_path)


def _end() -> None:
    """Store the compiled kernels and shut Taichi down. Taichi's own shutdown has no fixed order."""
    if os.getpid() == _process:
        with contextlib.suppress(Exception):  # a failure only makes later starts slower
            FIRST_LAUNCHES.close()
        await_lock(ti.lang.impl.current_cfg().offline_cache_file_path)
        ti.reset()
        if _checked_kernels is not None:
            shutil.rmtree(_checked_kernels, ignore_errors=True)
        with contextlib.suppress(OSError):  # raised if the folder is not writable
            FIRST_LAUNCHES.keep()


def _bound(
    chosen: Device, started: set[int], since: int, cores: tuple[int, ...], is_left_to_us: bool
) -> Device:
    """Bind Taichi's workers to cores, and return the device with its cores.

    The workers are the last threads in `started`, because Taichi starts its compiler threads before them.
    With the default cores, the workers stay unbound if the system refuses. They also stay unbound if other
    code has started threads in the meantime, because these threads must not be bound by mistake.
    """
    if is_left_to_us and len(started) != ti.lang.impl.current_cfg().num_compile_threads + chosen.threads:
        return chosen
    try:
        bind_youngest(started, since, cores)
    except DeviceError:
        if not is_left_to_us:
            raise
        return chosen
    return replace(chosen, cores=cores)


def make_fields(function: Callable[[], Result]) -> Result:
    """Call a function that makes Taichi fields, lay the fields out, and return the result of the function.

    Other threads and Ctrl-C wait until the fields are laid out.
    """

    def make() -> Result:
        made = function()
        ti.lang.impl.get_runtime().materialize()
        return made

    return _at_home(make, device().arch)


def export_kernels(folder: Path, kernels: Mapping[str, tuple[Any, dict[str, Any]]], fields: Any) -> None:
    """Write kernels for programs without Python. This process cannot use Taichi after the export.

    Kernels are compiled from their source, because the short body of a known kernel must not be exported.

    Args:
        folder: folder to write to.
        kernels: kernels by name, each with its template arguments and an example of each array argument.
        fields: first field of each layout for which the kernels are compiled.
    """

    def write() -> None:
        module = ti.aot.Module(ti.x64)
        for number, field in enumerate([_first_field, *fields]):
            module.add_field(f"layout{number}", field)
        functions = {kernel for kernel, _ in kernels.values()}
        with FIRST_LAUNCHES.making_anew(functions):
            for name, (kernel, arguments) in kernels.items():
                module.add_kernel(kernel, arguments, name)
            module.save(str(folder))

    _at_home(write, device().arch)


def _at_home(function: Callable[[], Result], arch: str) -> Result:
    """Call a function in the thread in which Taichi 1.7 must start and lay out fields.

    On a CPU, this is a dedicated thread, because the thread of the first caller may end. On a GPU, and with
    index checks, it is the caller's thread. Index checks would crash a dedicated thread.
    """
    return function() if arch != "cpu" or os.environ.get(DEBUG) == "1" else at_home(function)


def _lay_out(lay_out: Callable[[bool], None], is_first_call: bool) -> None:
    """Lay out fields that other code has made. Taichi calls this function at the next kernel call."""
    if _device is not None and must_go_home():
        _at_home(functools.partial(lay_out, is_first_call), _device.arch)
    else:
        lay_out(is_first_call)


keep_branches_in_real_functions()
read_sources_once()
let_threads_in(_lay_out)
let_any_number_of_threads_run()
choose_by_comparison()
FIRST_LAUNCHES.install()


def _after_fork() -> None:
    """Mark this process as forked. A forked process has Taichi's memory but none of Taichi's threads."""
    if _device is None:
        leave_home()
        return
    leave_behind(_process)
    # Without this reference, the process would wait for the missing threads when it ends.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(ti.lang.impl.get_runtime().prog))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def device() -> Device:
    """Return the device in use. Raises: DeviceError before `init`."""
    if _device is None:
        raise DeviceError("Taichi is not started: call taichi_soft.init() first")
    return _device


def is_initialized() -> bool:
    """True after `init` has run in this process."""
    return _device is not None
