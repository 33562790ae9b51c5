"""Workers of a cluster of Dask distributed."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from concurrent import futures
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager, suppress
from typing import Any

from lab.extras import how_to_install, missing_packages
from lab.sweep.provenance import origin
from lab.sweep.task import Outcome, Task, Worker, compute
from taichi_soft.core.errors import MissingExtraError, SweepError
from taichi_soft.core.types import ArchName

TIMEOUTS = TimeoutError, futures.TimeoutError, asyncio.TimeoutError
"""They are one only since Python 3.11."""

CONNECT_LIMIT = 15.0
"""For the scheduler to answer [s]: a shared machine may stand still for ten."""

WORKER_LIMIT = 10.0
"""For its first worker to appear [s]."""

START_LIMIT = 120.0
"""For a worker to import this package and start Taichi [s]."""

RESTART_LIMIT = 30.0
"""For a worker to be restarted [s]."""

ANSWER_LIMIT = 30.0
"""For the scheduler to say which workers there are [s]."""

LOOK = 1.0
"""Whether a worker is still there is looked up this often [s]."""


@contextmanager
def cluster_workers(address: str, arch: ArchName = "cpu") -> Iterator[list[Worker]]:
    """The workers that a cluster has now. Workers started later take the place of lost ones.

    Each computes one point at a time, whatever threads it has.
    Args:
        address: of its scheduler, host:port.
    Raises: MissingExtraError; SweepError where it cannot be reached, has no workers, or they have other
            versions than we.
    """
    if missing_packages("cluster"):
        raise MissingExtraError(f"a cluster needs Dask's distributed: run {how_to_install('cluster')}")
    from distributed import Client

    try:
        try:
            client = Client(address, timeout=CONNECT_LIMIT, set_as_default=False)
        except AssertionError:  # Dask's own thread did not begin within ten seconds
            client = Client(address, timeout=CONNECT_LIMIT, set_as_default=False)
    except (OSError, ValueError, ImportError, AssertionError) as error:
        raise SweepError(
            f"no scheduler of Dask answers at {address!r} ({error or 'a thread of ours did not begin'}): "
            "start one with 'dask scheduler'"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKER_LIMIT)
        except TIMEOUTS:
            raise SweepError(
                f"the cluster at {address!r} has no workers: start some with "
                f"'dask worker {address} --nthreads 1'"
            ) from None
        _require_same_code(client, arch)
        addresses = _Addresses(client)
        yield [ClusterWorker(client, addresses, arch) for _ in addresses.all()]


def _require_same_code(client: Any, arch: ArchName) -> None:
    mine = origin(arch)
    with _losses():
        found = client.run(origin, arch, on_error="return", callback_timeout=START_LIMIT)
    for worker, theirs in found.items():
        if theirs != mine:
            raise SweepError(
                f"worker {worker} of the cluster runs other code ({theirs}, wanted {mine}): install the same "
                "versions there"
            )


@contextmanager
def _losses() -> Iterator[None]:
    """Raises: SweepError where the scheduler does not answer any more."""
    try:
        yield
    except (OSError, *TIMEOUTS) as error:
        raise SweepError(
            f"the scheduler of the cluster was lost ({error}): start it, and the same command again"
        ) from error


class _Addresses:
    """The workers of a cluster, and which of them nobody uses yet."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._claimed: set[str] = set()
        self._lock = threading.Lock()

    def all(self) -> list[str]:
        """Raises: SweepError."""
        with _losses():
            return list(self._client.nthreads(callback_timeout=ANSWER_LIMIT))

    def claim(self) -> str | None:
        """The address of a worker that was never claimed before."""
        with self._lock:
            found = next((name for name in self.all() if name not in self._claimed), None)
            if found is not None:
                self._claimed.add(found)
            return found


class ClusterWorker:
    """A worker of a cluster; where it was lost, another one."""

    def __init__(self, client: Any, addresses: _Addresses, arch: ArchName) -> None:
        self._client, self._addresses, self._arch = client, addresses, arch
        self._address: str | None = None
        self._is_started = False
        self._future: Future[Outcome] | None = None
        self._is_stopped = False

    def is_ready(self) -> bool:
        if self._address not in self._addresses.all():
            self._address, self._is_started = self._addresses.claim(), False
        return self._address is not None

    def compute(self, task: Task, time_limit: float) -> Outcome:
        if not self._is_started:
            outcome = self._run(dict, {}, START_LIMIT)  # imports this package and starts Taichi
            if outcome.numbers is None:
                return outcome
            self._is_started = True
        return self._run(task.function, task.point, time_limit)

    def _run(
        self, function: Callable[[dict[str, Any]], dict[str, Any]], point: dict[str, Any], time_limit: float
    ) -> Outcome:
        start = time.perf_counter()
        executor = self._client.get_executor(
            workers=[self._address], allow_other_workers=False, pure=False, retries=0
        )
        self._future = executor.submit(compute, self._arch, function, point)
        error = ""
        while not error:
            try:
                return self._future.result(timeout=LOOK)
            except TIMEOUTS:
                if self._is_stopped:
                    error = "cancelled"
                elif self._address not in self._addresses.all():
                    error = f"worker {self._address} of the cluster was lost"
                elif time.perf_counter() > start + time_limit:
                    error = f"stopped: it took longer than {time_limit:g} s"
                    self._restart()
            except CancelledError:
                error = "cancelled"
            except Exception as cause:
                error = f"worker {self._address} of the cluster failed: {type(cause).__name__}: {cause}"
        self._future.cancel()
        self._address = None
        return Outcome(None, error, time.perf_counter() - start)

    def stop(self) -> None:
        """It computes its point to the end all the same: Dask cannot interrupt it."""
        self._is_stopped = True
        if self._future is not None:
            self._future.cancel()

    def _restart(self) -> None:
        """A worker without a nanny cannot be restarted: it is left to itself."""
        with suppress(ValueError, OSError, RuntimeError, *TIMEOUTS):
            self._client.restart_workers([self._address], timeout=RESTART_LIMIT)
