"""Processes on this machine that compute points."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from lab.sweep.task import Outcome, Task, Worker, compute
from taichi_soft.core.cores import available_cores
from taichi_soft.core.types import ArchName

CONTEXT = multiprocessing.get_context("spawn")

START_LIMIT = 120.0
"""For a new process to start Python and import this package [s]."""

END_LIMIT = 10.0
"""For a process to end by itself, in which Taichi writes compiled kernels to its cache [s]."""


@contextmanager
def local_workers(count: int | None = None, arch: ArchName = "cpu") -> Iterator[list[Worker]]:
    """Processes of one thread each, started when they are needed; None: one for each core."""
    workers = [LocalWorker(arch) for _ in range(count or len(available_cores()))]
    try:
        yield list(workers)
    finally:
        for worker in workers:
            worker.end()


class LocalWorker:
    """A process of this machine; where it was lost, the next point starts another one."""

    def __init__(self, arch: ArchName) -> None:
        self._arch = arch
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._is_stopped = False

    def is_ready(self) -> bool:
        return True

    def compute(self, task: Task, time_limit: float) -> Outcome:
        start = time.perf_counter()
        try:
            pipe = self._pipe or self._start()
            start = time.perf_counter()
            if self._is_stopped:  # while the process was starting
                self._kill()
            pipe.send((task.function, task.point))
            outcome: Outcome = _receive(pipe, time_limit)
            return outcome
        except TimeoutError:
            self._kill()
            self._lose()
            error = f"stopped: it took longer than {time_limit:g} s"
        except (EOFError, OSError):
            error = f"its process was lost: {self._lose()}"
        return Outcome(None, error, time.perf_counter() - start)

    def stop(self) -> None:
        self._is_stopped = True
        self._kill()

    def end(self) -> None:
        """Let the process end: it computes nothing now."""
        if self._process is None or self._pipe is None:
            return
        with suppress(OSError):
            self._pipe.send(None)
        self._lose()

    def _kill(self) -> None:
        process = self._process
        if process is not None:
            process.kill()

    def _start(self) -> Connection:
        self._pipe, theirs = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_serve, args=(theirs, self._arch), daemon=True)
        _start_unseen(self._process)
        theirs.close()
        _receive(self._pipe, START_LIMIT)
        return self._pipe

    def _lose(self) -> str:
        """Forget a process that has ended, or is about to, and say how."""
        assert self._process is not None
        assert self._pipe is not None
        self._pipe.close()
        self._process.join(END_LIMIT)
        self._process.kill()
        self._process.join()
        code = self._process.exitcode
        self._process = self._pipe = None
        if code is None or code >= 0:
            return f"exit code {code}"
        return f"killed by {signal.Signals(-code).name}"


def _receive(pipe: Connection, time_limit: float) -> Outcome:
    """Raises: TimeoutError; EOFError where the process is gone."""
    if not pipe.poll(time_limit):
        raise TimeoutError
    outcome: Outcome = pipe.recv()
    return outcome


def _start_unseen(process: SpawnProcess) -> None:
    """Start a process that does not see Ctrl-C: it is told when to end."""
    if not hasattr(signal, "pthread_sigmask"):
        process.start()
        return
    resource_tracker.ensure_running()  # or it would be started below, and unblock signals
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    process.start()
    signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(pipe: Connection, arch: ArchName) -> None:
    """Compute what is sent until None is, or nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, BrokenPipeError):
        pipe.send(compute(arch, dict, {}))  # starts Taichi
        for function, point in iter(pipe.recv, None):
            pipe.send(compute(arch, function, point))
