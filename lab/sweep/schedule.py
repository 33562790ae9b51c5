"""Assign points to worker processes."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from multiprocessing.connection import wait

from lab.sweep.task import Outcome, Task
from lab.sweep.worker import Worker
from taichi_soft.core.cores import available_cores
from taichi_soft.core.types import ArchName

TIME_LIMIT = 1800.0
"""Time limit of a point [s]."""

LOOK = 0.5
"""Interval between checks of time limits [s]. On systems where Ctrl-C does not interrupt a wait, Ctrl-C takes
effect at the next check."""


def compute_all(
    tasks: Sequence[Task],
    *,
    workers: int | None = None,
    arch: ArchName = "cpu",
    time_limit: float = TIME_LIMIT,
) -> Generator[tuple[Task, Outcome], None, None]:
    """Compute points and yield each outcome when it is ready. Points that must run alone come last.

    The outcome of a failed point contains its error: an exception, a lost process, or a timeout. Closing the
    iterator stops the computation: use `contextlib.closing`.

    Args:
        workers: number of processes; None for one per core. Each process has one thread and starts when it is
            needed.
        time_limit: time limit of a point [s].
    """
    crew = [Worker(arch, time_limit) for _ in range(workers or len(available_cores()))]
    try:
        yield from _compute([task for task in tasks if not task.is_alone], crew)
        yield from _compute([task for task in tasks if task.is_alone], crew[:1])
    except BaseException:
        for worker in crew:
            worker.kill()
        raise
    finally:
        for worker in crew:
            worker.end()


def _compute(tasks: Sequence[Task], crew: Sequence[Worker]) -> Iterator[tuple[Task, Outcome]]:
    waiting = Waiting(tasks)
    known: list[set[str]] = [set() for _ in crew]
    while True:
        for worker, groups in zip(crew, known, strict=True):
            if not worker.is_busy and (task := waiting.take(groups)):
                worker.begin(task)
        busy = [worker for worker in crew if worker.is_busy]
        if not busy:
            return
        wait([worker.pipe for worker in busy], LOOK)
        for worker in busy:
            if done := worker.look():
                yield done


class Waiting:
    """Points that are not yet started, by group."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        self._groups: dict[str, list[Task]] = {}
        self._begun: set[str] = set()
        for task in tasks:
            self._groups.setdefault(task.group, []).append(task)

    def take(self, known: set[str]) -> Task | None:
        """Remove and return the next point for a worker; None if no point is left.

        The worker first gets points of groups that it has already computed, then a point of a group that no
        worker has started, then a point of the group with the most points left.
        Args:
            known: groups that the worker has computed; the point's group is added.
        """
        left = [name for name, tasks in self._groups.items() if tasks]
        if not left:
            return None
        own = [name for name in left if name in known]
        new = [name for name in left if name not in self._begun]
        name = (own or new or sorted(left, key=lambda name: -len(self._groups[name])))[0]
        self._begun.add(name)
        known.add(name)
        return self._groups[name].pop(0)
