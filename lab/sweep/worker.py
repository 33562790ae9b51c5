"""Worker processes on this machine that compute points."""

from __future__ import annotations

import multiprocessing
import signal
import time
from contextlib import suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess

from lab.sweep.task import Outcome, Task, compute
from taichi_soft.core.types import ArchName

CONTEXT = multiprocessing.get_context("spawn")

START_LIMIT = 120.0
"""Time limit for a new process to start Python, import this package and start Taichi [s]."""

END_LIMIT = 10.0
"""Time limit for a process to exit [s]. Meanwhile Taichi writes compiled kernels to its cache."""


class Worker:
    """A process that computes one point at a time. If the process is lost, the next point starts a new one.

    `concurrent.futures` is not sufficient: before Python 3.14 it cannot end a process that hangs, it does not
    report how a process ended, and its workers remain if the parent process is killed.
    """

    def __init__(self, arch: ArchName, time_limit: float) -> None:
        self._arch, self._time_limit = arch, time_limit
        self._task: Task | None = None
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._is_starting = False
        self._began = 0.0

    @property
    def is_busy(self) -> bool:
        """True while the process computes a point."""
        return self._task is not None

    @property
    def pipe(self) -> Connection:
        """Pipe that becomes readable when `look` can return an outcome."""
        assert self._pipe is not None
        return self._pipe

    def begin(self, task: Task) -> None:
        """Start to compute a point, and return immediately."""
        if self._process is None:
            self._start()
        self._task, self._began = task, time.perf_counter()
        with suppress(OSError):  # `look` reports a lost process
            self.pipe.send((task.function, task.point))

    def look(self) -> tuple[Task, Outcome] | None:
        """Return the point of this worker and its outcome, or None while the point is still being computed.

        The outcome contains an error if the point exceeded its time limit or its process was lost.
        """
        task = self._task
        assert task is not None
        try:
            while self.pipe.poll():
                outcome: Outcome | None = self.pipe.recv()
                if outcome is not None:
                    self._task = None
                    return task, outcome
                self._is_starting, self._began = False, time.perf_counter()
            limit, what = self._time_limit, "took longer than"
            if self._is_starting:
                limit, what = START_LIMIT, "did not start within"
            if time.perf_counter() < self._began + limit:
                return None
            self.kill()
            error = f"stopped: it {what} {limit:g} s"
        except (EOFError, OSError):
            error = f"its process was lost: {self.end()}"
        self._task = None
        return task, Outcome(None, error, time.perf_counter() - self._began)

    def kill(self) -> None:
        """Kill the process."""
        if self._process is not None:
            self._process.kill()
            self.end()

    def end(self) -> str:
        """Wait until the process exits, and kill it after `END_LIMIT`.

        Returns: a description of how the process ended.
        """
        if self._process is None:
            return ""
        self.pipe.close()
        self._process.join(END_LIMIT)
        self._process.kill()
        self._process.join()
        code = self._process.exitcode
        self._process = self._pipe = None
        return f"exit code {code}" if code is None or code >= 0 else f"killed by {signal.Signals(-code).name}"

    def _start(self) -> None:
        """Start a process that ignores Ctrl-C. The process ends when the pipe is closed."""
        self._is_starting = True
        self._pipe, theirs = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_serve, args=(theirs, self._arch), daemon=True)
        if hasattr(signal, "pthread_sigmask"):
            resource_tracker.ensure_running()  # otherwise `start` starts the tracker, which unblocks signals
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            self._process.start()
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        else:
            self._process.start()
        theirs.close()


def _serve(pipe: Connection, arch: ArchName) -> None:
    """Compute points from the pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    compute(arch, dict, {})  # starts Taichi
    with suppress(EOFError, ConnectionError):
        pipe.send(None)
        while True:
            function, point = pipe.recv()
            pipe.send(compute(arch, function, point))
