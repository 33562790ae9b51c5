"""Taichi, started once.

Every other module takes `ti` from here, after the workarounds of `taichi_soft.core.taichi_workarounds` were
applied to it. Only this module calls `ti.init`, which would reset every field in the process.
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
"""Name of the environment variable that at 1 has every index in a kernel checked: slow, for tests only."""

_MOST_THREADS = 256
_ARCHS = ("cpu", "cuda", "vulkan", "metal")


@dataclass(frozen=True)
class Device:
    """What `init` chose."""

    arch: ArchName  # "cpu", "cuda", "vulkan" or "metal"
    threads: int  # CPU worker threads (1 on a GPU: the host side is serial)
    reason: str  # one line for people
    cores: tuple[int, ...] = ()  # to which the worker threads are bound, one each; none where they are free

    @property
    def is_gpu(self) -> bool:
        """True where kernels run on a graphics processor."""
        return self.arch != "cpu"


_log = logging.getLogger(__name__)

_device: Device | None = None
_process = 0  # that started Taichi
_checked_kernels: str | None = None  # folder of those that check indices
_first_field: Any = None  # in a layout by itself: an empty one cannot be exported


@in_turn
def init(arch: ArchName = "auto", threads: int | None = None, cores: Sequence[int] | None = None) -> Device:
    """Start Taichi for this process and say what was chosen.

    Entry points call this; a library that embeds taichi-soft may call it first with its own choice. Any
    thread may. A process that is forked later gets a StateError: start processes by "spawn".
    A second call with compatible arguments does nothing, because starting again would destroy the
    fields of every world. Where the environment has TAICHI_SOFT_DEBUG=1, kernels check every index.
    Args:
        arch: "auto" or "cpu"; or a GPU by name, "cuda", "vulkan" or "metal". "auto" takes the CPU,
            which is faster at what games have (docs/speed.md), and games want their GPU for pictures.
            "vulkan" and "metal" are untried.
        threads: CPU worker threads, 1 or more, of which no more are used than there are cores available to
            this process. The system moves them from core to core, and often wakes two on one: short frames
            then take nearly as long as with one thread.
        cores: on Linux, numbers of processor cores: as many CPU worker threads, each bound to one of them.
            Take cores that the rest of the game leaves alone, as a bound thread cannot go elsewhere, and call
            this before others start threads.
            With neither `threads` nor `cores` there is a thread for each core available to this process, on
            Linux bound to it where the system allows that.
    Returns: the device in use.
    Raises: OptionError for an unknown arch, thread count or core, or if already started differently;
        DeviceError if the device asked for is missing, or threads cannot be bound; StateError in a process
        that was forked after a start.
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
    taken = () if _device is None else _device.cores  # the caller may have left them to our threads since
    bound = () if cores is None else require_cores(cores, sorted({*there, *taken}))
    if bound and (arch not in ("auto", "cpu") or threads not in (None, len(bound))):
        raise OptionError(
            f"cores {list(bound)} are for {len(bound)} CPU threads, got arch={arch!r}, threads={threads}: "
            "leave out one or the other"
        )
    # Taichi starts no more than there are, and the flat schedule waits for all of them.
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
    reason = "the default" if arch == "auto" else "asked for by name"
    if ti.lang.impl.get_runtime().prog is not None:
        raise DeviceError(
            "Taichi was started by ti.init, and starting it again would destroy the fields made since: call "
            "taichi_soft.init() instead, first in the process"
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
    """Start Taichi, with its workers on these cores if there are any, and note the device."""
    global _device, _process, _checked_kernels, _first_field
    is_checked = os.environ.get(DEBUG) == "1"
    before, since = (thread_ids(), number_now()) if cores else (set(), 0)
    options = {}
    if is_checked:
        # What is kept does not notice changed options. But without a cache Taichi 1.7 takes kernels for one
        # that differ only in which instance of a real function they call.
        options["offline_cache_file_path"] = _checked_kernels = tempfile.mkdtemp()
    else:
        await_lock(ti.lang.impl.default_cfg().offline_cache_file_path)
    with contextlib.redirect_stdout(io.StringIO()):  # Taichi announces itself
        ti.init(
            arch=getattr(ti, arch),
            cpu_max_num_threads=threads,
            default_fp=ti.f32,
            default_ip=ti.i32,
            fast_math=False,  # would let each processor choose an order of sums, and so the last bits
            debug=is_checked,
            offline_cache=True,
            offline_cache_max_size_of_files=1
            << 29,  # a game of many kinds of worlds fills the default 100 MB
            enable_fallback=False,
            cfg_optimization=False,  # halves the compile time; the kernels run as fast without it
            detect_read_only=False,  # a GPU might not see what a real function wrote
            make_cpu_multithreading_loop=False,  # it would put up to 512 bodies into one thread
            unrolling_limit=0,  # no warning
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
    ti.lang.impl.get_runtime().materialize()  # once, by the first kernel otherwise, in whichever thread
    if has_known:
        keep_kernels_apart(VERSION)
        FIRST_LAUNCHES.open(KnownKernels(kernel_folder(), code_options()))
    _process = os.getpid()
    atexit.register(_end)
    _device = Device(arch=arch, threads=threads if arch == "cpu" else 1, reason=reason)
    if cores:
        _device = _bound(_device, thread_ids() - before, since, cores, is_left_to_us)


def kernel_folder() -> Path:
    """Where compiled kernels are kept for later processes, as this one ends."""
    return folder_of(ti.lang.impl.current_cfg().offline_cache_file_path)


def _end() -> None:
    """Let Taichi keep the kernels that it compiled: its own parts may go in any order."""
    if os.getpid() == _process:
        with contextlib.suppress(Exception):  # it only makes later starts shorter
            FIRST_LAUNCHES.close()
        await_lock(ti.lang.impl.current_cfg().offline_cache_file_path)
        ti.reset()
        if _checked_kernels is not None:
            shutil.rmtree(_checked_kernels, ignore_errors=True)
        with contextlib.suppress(OSError):  # the folder takes no files
            FIRST_LAUNCHES.keep()


def _bound(
    chosen: Device, started: set[int], since: int, cores: tuple[int, ...], is_left_to_us: bool
) -> Device:
    """The device with its workers, which Taichi starts after the threads that compile, bound to cores.

    Where the choice is ours they stay free if the system does not let us, or if somebody else has started
    threads meanwhile, which we must leave alone.
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
    """Call in turn what makes Taichi fields, and lay these out; whole, where Ctrl-C is pressed meanwhile."""

    def make() -> Result:
        made = function()
        ti.lang.impl.get_runtime().materialize()
        return made

    return _at_home(make, device().arch)


def export_kernels(folder: Path, kernels: Mapping[str, tuple[Any, dict[str, Any]]], fields: Any) -> None:
    """Write kernels for programs without Python: the last thing that this process does with Taichi.

    They are made from their source: where a file of a known kernel is missing, its short body would be
    written here.

    Args:
        kernels: by name, each with its template arguments, and an array like each of the others.
        fields: the first fields of each of the layouts that they are compiled for.
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
    """Call what Taichi does in one and the same thread only. On a CPU it is a thread of our own, on a GPU the
    caller's; and where indices are checked, which ends the process in ours."""
    return function() if arch != "cpu" or os.environ.get(DEBUG) == "1" else at_home(function)


def _lay_out(lay_out: Callable[[bool], None], is_first_call: bool) -> None:
    """Lay out fields that somebody else made, which Taichi does where a kernel is called first."""
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
    """Of the process that was forked: it has Taichi's memory and none of its threads."""
    if _device is None:
        leave_home()
        return
    leave_behind(_process)
    # The end of this process would wait for these threads, if the program were taken down.
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(ti.lang.impl.get_runtime().prog))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def device() -> Device:
    """The device in use. Raises: DeviceError before `init`."""
    if _device is None:
        raise DeviceError("Taichi is not started: call taichi_soft.init() first")
    return _device


def is_initialized() -> bool:
    """True once `init` has run in this process."""
    return _device is not None
