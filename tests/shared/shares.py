"""Assign test files to workers."""

import contextlib
from collections import Counter

from xdist.scheduler import LoadScopeScheduling

SECONDS = "taichi_soft/seconds"
"""Key in pytest's cache: duration of each test in its first run on this machine [s]."""


class Shares(LoadScopeScheduling):
    """Scheduler that divides the list of files into one share per worker.

    A worker that has finished its share takes the last file of the longest other share.

    Taichi's cache on disk finds a kernel only if the process has allocated as many fields before it as when
    the kernel was stored. Therefore each worker should run the same files in the same order every time, and
    new measurements must not change the shares. Only the first duration of each test counts, until `pytest
    --cache-clear`.
    """

    def __init__(self, config, log=None):
        super().__init__(config, log)
        self.seconds = dict(config.cache.get(SECONDS, {}))
        self.seconds_of_file, self.share_of_file, self.share_of_node = Counter(), {}, {}
        config.add_cleanup(lambda: config.cache.set(SECONDS, self.seconds))

    def mark_test_complete(self, node, item_index, duration=0):
        self.seconds.setdefault(self.collection[item_index], max(round(duration, 2), 0.01))
        super().mark_test_complete(node, item_index, duration)

    def remove_node(self, node):
        """Report a test that ended its worker only once. The base class would run the test again."""
        units = self.assigned_work[node]
        crashed = next((test for unit in units.values() for test, done in unit.items() if not done), None)
        if crashed:
            units[self._split_scope(crashed)][crashed] = True
        super().remove_node(node)
        return crashed

    def _split_scope(self, nodeid):
        return nodeid.split("::")[0]

    def _reschedule(self, node):
        if (
            node in self.registered_collections
        ):  # the base class would assign files to a worker that is still starting
            super()._reschedule(node)

    def _assign_work_unit(self, node):
        self.workqueue.move_to_end(self._next_file(node), last=False)
        with contextlib.suppress(OSError):  # the worker has just ended, and `remove_node` reassigns its files
            super()._assign_work_unit(node)
        if self.workqueue and self._pending_of(self.assigned_work[node]) < 2:
            self._assign_work_unit(node)  # a worker starts a test only when it has the next one

    def _next_file(self, node):
        if not self.share_of_file:
            self._cut()
        share = self.share_of_node.setdefault(node, len(self.share_of_node))
        waiting = {}
        for file in filter(self.workqueue.__contains__, self.share_of_file):
            waiting.setdefault(self.share_of_file[file], []).append(file)
        if share in waiting:
            return waiting[share][0]
        return max(waiting.values(), key=lambda files: sum(self.seconds_of_file[file] for file in files))[-1]

    def _cut(self):
        for nodeid in self.collection:  # 1 s for a test without a record
            self.seconds_of_file[self._split_scope(nodeid)] += self.seconds.get(nodeid, 1.0)
        before, length = 0.0, self.seconds_of_file.total() / self.numnodes
        for file, seconds in self.seconds_of_file.items():
            self.share_of_file[file] = int((before + seconds / 2) / length)
            before += seconds
