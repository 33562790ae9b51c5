"""Who computes what next, with workers that only pretend."""

import threading
from contextlib import closing

import pytest

from lab.sweep import Outcome, Task, compute_all, schedule
from taichi_soft.core.errors import SweepError


class Pretender:
    """Computes `lives` points, then its process is lost for good."""

    def __init__(self, lives=100):
        self.lives, self.groups = lives, []
        self.stopped = threading.Event()

    def is_ready(self):
        return self.lives > 0

    def compute(self, task, time_limit):
        self.lives -= 1
        self.groups.append(task.group)
        if task.point == {"wait": True}:
            self.stopped.wait()
        if task.point == {"bug": True}:
            raise ZeroDivisionError
        return Outcome({}, seconds=time_limit)

    def stop(self):
        self.stopped.set()


def tasks(groups):
    return [Task(group, dict, {"x": x}) for x, group in enumerate(groups)]


def test_one_worker_ends_a_group_before_it_begins_another():
    worker = Pretender()
    assert len(list(compute_all(tasks("abcabcaab"), [worker], 2.0))) == 9
    assert "".join(worker.groups) == "aaaabbbcc"


def test_workers_keep_to_their_groups_then_begin_others_then_help_where_most_is_left():
    waiting = schedule._Waiting(tasks("abbbbcccccc"))
    known = [[], [], []]
    taken = [[waiting.take(each) for each in known] for _ in range(4)]
    assert taken[-1].pop() is None
    groups = [[task.group for task in row] for row in taken]
    assert groups == [["a", "b", "c"], ["c", "b", "c"], ["c", "b", "c"], ["c", "b"]]
    assert sorted(task.point["x"] for row in taken for task in row) == list(range(11))


def test_nothing_to_compute():
    assert list(compute_all([], [Pretender()])) == []


def test_where_a_worker_is_lost_another_computes_the_rest(monkeypatch):
    monkeypatch.setattr(schedule, "PATIENCE", 0.3)
    lost, sound = Pretender(lives=1), Pretender()
    assert len(list(compute_all(tasks("aabb"), [lost, sound]))) == 4
    assert len(lost.groups) <= 1


def test_where_no_worker_is_left_the_sweep_says_how_many_points_are_missing(monkeypatch):
    monkeypatch.setattr(schedule, "PATIENCE", 0.3)
    done = []
    with pytest.raises(SweepError, match="no worker is left for 3 points"):
        done.extend(compute_all(tasks("aaaaa"), [Pretender(lives=1), Pretender(lives=1)]))
    with pytest.raises(SweepError, match="no worker is left for 1 points"):
        done.extend(compute_all([Task("a", dict, {}, is_alone=True)], [Pretender(lives=0)]))


def test_what_runs_alone_runs_on_a_worker_that_is_left():
    assert (
        len(list(compute_all([Task("a", dict, {}, is_alone=True)], [Pretender(lives=0), Pretender()]))) == 1
    )


def test_who_looks_no_further_stops_what_is_being_computed():
    worker = Pretender()
    with closing(compute_all([Task("a", dict, {}), Task("a", dict, {"wait": True})], [worker])) as done:
        next(done)
    assert worker.stopped.is_set()


def test_an_error_of_the_worker_itself_is_raised():
    with pytest.raises(ZeroDivisionError):
        list(compute_all([Task("a", dict, {"bug": True})], [Pretender()]))
