"""Order in which points are computed, and times at which processes start and end."""

import os
from contextlib import closing

import pytest
from acts import act, root

from lab.sweep import Outcome, Task, compute_all, schedule

pytestmark = pytest.mark.soak


def tasks(groups, function=root, **point):
    return [Task(group, function, {"x": x, **point}) for x, group in enumerate(groups)]


def test_one_worker_ends_a_group_before_it_begins_another():
    done = [task for task, _ in compute_all(tasks("abcabcaab"), workers=1)]
    assert "".join(task.group for task in done) == "aaaabbbcc"
    assert [task.point["x"] for task in done] == [0, 3, 6, 7, 1, 4, 8, 2, 5]


def test_workers_keep_to_their_groups_then_begin_others_then_help_where_most_is_left():
    waiting = schedule.Waiting(tasks("abbbbcccccc"))
    known = [set(), set(), set()]
    taken = [[waiting.take(each) for each in known] for _ in range(4)]
    assert taken[-1].pop() is None
    groups = [[task.group for task in row] for row in taken]
    assert groups == [["a", "b", "c"], ["c", "b", "c"], ["c", "b", "c"], ["c", "b"]]
    assert sorted(task.point["x"] for row in taken for task in row) == list(range(11))


def test_nothing_to_compute_starts_no_process(monkeypatch):
    monkeypatch.setattr(schedule.Worker, "begin", lambda *_: pytest.fail("it was given a point"))
    assert list(compute_all([])) == []


def test_numbers_are_the_same_for_any_number_of_workers():
    points = tasks("abababababab")
    found = [{t.point["x"]: o.numbers for t, o in compute_all(points, workers=n)} for n in (1, 3)]
    assert found[0] == found[1] == {x: {"root": x**0.5, "kinds": [True, "a", [1e-300]]} for x in range(12)}


def test_who_looks_no_further_ends_the_process_and_what_it_computes():
    points = [Task("a", act, {"x": x, "do": "sleep", "seconds": 600 * x}) for x in range(2)]
    with closing(compute_all(points, workers=1)) as done:
        _, outcome = next(done)
        os.kill(outcome.numbers["pid"], 0)
    with pytest.raises(ProcessLookupError):
        os.kill(outcome.numbers["pid"], 0)


def test_a_function_that_no_process_can_find_is_an_error_of_the_caller():
    with pytest.raises(AttributeError, match="local"):
        list(compute_all([Task("a", lambda point: point, {})]))


def test_a_process_that_does_not_start_in_time_loses_its_point(monkeypatch):
    monkeypatch.setattr("lab.sweep.worker.START_LIMIT", 0.1)
    ((_, outcome),) = compute_all(tasks("a"), workers=1)
    assert outcome == Outcome(None, "stopped: it did not start within 0.1 s", outcome.seconds)
