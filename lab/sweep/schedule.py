"""Which point is computed next, and by whom."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Generator, Iterator, Sequence

from lab.sweep.task import Outcome, Task, Worker
from taichi_soft.core.errors import SweepError

TIME_LIMIT = 1800.0
"""Of a point [s]."""

PATIENCE = 30.0
"""How long a worker without a process waits for another one [s]."""


def compute_all(
    tasks: Sequence[Task], workers: Sequence[Worker], time_limit: float = TIME_LIMIT
) -> Generator[tuple[Task, Outcome], None, None]:
    """Compute points and yield them as they are done; those that have to be alone last, one after the other.

    Closing the iterator stops what is being computed: use `contextlib.closing`.
    Raises: SweepError where no worker is left.
    """
    alone = [task for task in tasks if task.is_alone]
    together = [task for task in tasks if not task.is_alone]
    yield from _compute(together, workers, time_limit)
    first = next((worker for worker in workers if worker.is_ready()), workers[0])
    yield from _compute(alone, [first], time_limit)


class _Waiting:
    """Points not yet begun, by group, for several threads."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._lock = threading.Lock()
        self._groups: dict[str, list[Task]] = {}
        self._begun: set[str] = set()
        for task in tasks:
            self._groups.setdefault(task.group, []).append(task)

    def __len__(self) -> int:
        with self._lock:
            return sum(map(len, self._groups.values()))

    def take(self, known: list[str]) -> Task | None:
        """The next point for a worker that has computed points of the groups `known`, which is added to: of
        these, or of a group that nobody has begun, or else of the one with most points left."""
        with self._lock:
            left = [name for name, tasks in self._groups.items() if tasks]
            if not left:
                return None
            own = [name for name in left if name in known]
            new = [name for name in left if name not in self._begun]
            name = (own or new or sorted(left, key=lambda name: -len(self._groups[name])))[0]
            self._begun.add(name)
            known.append(name)
            return self._groups[name].pop(0)

    def clear(self) -> None:
        """Nothing more is to be begun."""
        with self._lock:
            self._groups.clear()


_Done = queue.SimpleQueue[tuple[Task, Outcome] | Exception | None]


def _compute(
    tasks: Sequence[Task], workers: Sequence[Worker], time_limit: float
) -> Iterator[tuple[Task, Outcome]]:
    if not tasks:
        return
    waiting, done = _Waiting(tasks), _Done()
    threads = [
        threading.Thread(target=_serve, args=(worker, waiting, done, time_limit), daemon=True)
        for worker in workers
    ]
    for thread in threads:
        thread.start()
    try:
        active = len(threads)
        while active:
            item = _next(done)
            if item is None:
                active -= 1
            elif isinstance(item, Exception):
                raise item
            else:
                yield item
        if waiting:
            raise SweepError(
                f"no worker is left for {len(waiting)} points: start workers, and the same command again"
            )
    except BaseException:
        waiting.clear()
        for worker in workers:
            worker.stop()
        raise
    finally:
        for thread in threads:
            thread.join()


def _next(done: _Done) -> tuple[Task, Outcome] | Exception | None:
    """Wait, but for no longer than it may take until Ctrl-C is heard, where a lock cannot be interrupted."""
    while True:
        try:
            return done.get(timeout=0.5)
        except queue.Empty:
            continue


def _serve(worker: Worker, waiting: _Waiting, done: _Done, time_limit: float) -> None:
    """Compute points with one worker until none is waiting, or its process is lost for good."""
    known: list[str] = []
    seen = time.monotonic()
    try:
        while waiting and time.monotonic() < seen + PATIENCE:
            if not worker.is_ready():
                time.sleep(0.2)
            elif task := waiting.take(known):
                done.put((task, worker.compute(task, time_limit)))
                seen = time.monotonic()
    except Exception as error:
        done.put(error)
    finally:
        done.put(None)
