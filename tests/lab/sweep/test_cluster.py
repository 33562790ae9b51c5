"""A cluster of Dask of two workers on this machine, in processes of their own."""

import os
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from acts import act, root

from lab.sweep import Task, cluster_workers, compute_all, local_workers
from taichi_soft.core.errors import SweepError

TIME_LIMIT = 12.0
"""For a point that hangs [s]: longer than a shared machine stands still now and then."""

distributed = pytest.importorskip("distributed")


CLUSTER = """
import faulthandler
from sys import stdin
from distributed import LocalCluster
if __name__ == "__main__":
    faulthandler.dump_traceback_later(120, exit=True)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        faulthandler.cancel_dump_traceback_later()
        print(cluster.scheduler_address, flush=True)
        stdin.read()
"""


class Cluster:
    """A scheduler and its workers, which end with the process that started them."""

    def __init__(self, script):
        paths = [str(Path(__file__).parent), *sys.path]  # the workers import `acts`
        self._process = subprocess.Popen(
            [sys.executable, script],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        )
        self.scheduler_address = self._process.stdout.readline().strip()
        assert self.scheduler_address, "it did not start: its last words are above"

    def signal(self, number):
        os.killpg(self._process.pid, number)

    def close(self):
        """As where the power fails: nobody says goodbye."""
        if self._process.poll() is None:
            self.signal(signal.SIGKILL)
        self._process.communicate()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    script = tmp_path_factory.mktemp("cluster") / "cluster.py"
    script.write_text(CLUSTER)
    cluster = Cluster(script)
    yield cluster
    cluster.close()


def outcomes(tasks, crew):
    with closing(compute_all(tasks, crew, TIME_LIMIT)) as done:
        return {task.point["x"]: outcome for task, outcome in done}


def test_the_same_numbers_come_from_a_cluster_and_from_this_machine(cluster):
    tasks = [Task("ab"[x % 2], root, {"x": x}, is_alone=x > 8) for x in range(10)]
    with cluster_workers(cluster.scheduler_address) as crew:
        assert len(crew) == 2
        theirs = outcomes(tasks, crew)
    with local_workers(1) as crew:
        ours = outcomes(tasks, crew)
    assert list(theirs)[-1] == list(ours)[-1] == 9
    for x in range(10):
        assert theirs[x].numbers == ours[x].numbers == {"root": x**0.5, "kinds": [True, "a", [1e-300]]}


def test_workers_with_other_code_are_refused(cluster, monkeypatch):
    monkeypatch.setattr("lab.sweep.provenance._digest", lambda: "another")
    with (
        pytest.raises(SweepError, match="install the same versions"),
        cluster_workers(cluster.scheduler_address),
    ):
        pass


def test_a_worker_that_dies_or_hangs_loses_one_point_and_is_replaced(cluster):
    acts = ("exit", "raise", "sleep", "", "", "")
    tasks = [Task("a", act, {"x": x, "do": do, "seconds": 600}) for x, do in enumerate(acts)]
    with cluster_workers(cluster.scheduler_address) as crew:
        done = outcomes(tasks, crew)
    assert [done[x].numbers is None for x in range(6)] == [True] * 3 + [False] * 3
    assert "of the cluster was lost" in done[0].error
    assert done[1].error.startswith("ValueError: no numbers (acts.py:")
    assert done[2].error.startswith("stopped: it took longer than 12 s")


def test_a_client_whose_thread_is_late_is_started_again(cluster, monkeypatch):
    start, starts = distributed.Client, []

    def start_late(*arguments, **options):
        starts.append(arguments)
        if len(starts) == 1:
            raise AssertionError
        return start(*arguments, **options)

    monkeypatch.setattr(distributed, "Client", start_late)
    with cluster_workers(cluster.scheduler_address) as crew:
        assert len(crew) == 2
    assert len(starts) == 2


def test_a_cluster_that_stands_still_ends_the_sweep(cluster, monkeypatch):
    """Its connections are open, but nobody answers."""
    monkeypatch.setattr("lab.sweep.cluster.ANSWER_LIMIT", 1.0)
    tasks = [Task("a", act, {"x": x, "do": "sleep", "seconds": 0.2}) for x in range(500)]

    def compute_some():
        with (
            cluster_workers(cluster.scheduler_address) as crew,
            closing(compute_all(tasks, crew, TIME_LIMIT)) as outcomes,
        ):
            next(outcomes)
            cluster.signal(signal.SIGSTOP)
            list(outcomes)

    try:
        with pytest.raises(SweepError, match="scheduler of the cluster was lost"):
            compute_some()
    finally:
        cluster.signal(signal.SIGCONT)


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nonsense", "moon://x:1", ""])
def test_no_cluster_is_one_line(address, monkeypatch):
    monkeypatch.setattr("lab.sweep.cluster.CONNECT_LIMIT", 1.0)
    with pytest.raises(SweepError, match="dask scheduler") as caught, cluster_workers(address):
        pass
    assert repr(address) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_cluster_that_goes_away_ends_the_sweep_with_what_there_is(cluster):
    """The last test: it closes the cluster."""
    tasks = [Task("a", act, {"x": x, "do": "sleep", "seconds": 0.2}) for x in range(500)]
    done = []

    def compute_some():
        with (
            cluster_workers(cluster.scheduler_address) as crew,
            closing(compute_all(tasks, crew, TIME_LIMIT)) as outcomes,
        ):
            for _, outcome in outcomes:
                done.append(outcome.error)
                if len(done) == 4:
                    cluster.close()

    with pytest.raises(SweepError, match="scheduler of the cluster was lost"):
        compute_some()
    assert done[:4] == [""] * 4
    assert len(done) < 500
