"""A cluster of Dask of two processes on this machine."""

from contextlib import closing

import pytest
from acts import act, root

from taichi_soft.core.errors import SweepError
from taichi_soft.lab.sweep import Task, cluster_workers, compute_all, local_workers

TIME_LIMIT = 12.0
"""For a point that hangs [s]: longer than a shared machine stands still now and then."""

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        yield cluster


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
    monkeypatch.setattr("taichi_soft.lab.sweep.provenance._digest", lambda: "another")
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


@pytest.mark.parametrize("address", ["127.0.0.1:1", "nonsense", "moon://x:1", ""])
def test_no_cluster_is_one_line(address, monkeypatch):
    monkeypatch.setattr("taichi_soft.lab.sweep.cluster.CONNECT_LIMIT", 1.0)
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
