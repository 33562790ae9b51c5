"""Experiments whose points are measured, stored, resumed and concluded."""

import io
from pathlib import Path

import pytest
from fakes import CARELESS, ROUGH, SQUARES
from rich.console import Console

from lab.experiments import EXPERIMENTS, Effort, Verdict
from lab.report import run
from lab.sweep import Store, SweepError
from taichi_soft.core.errors import OptionError

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab"), pytest.mark.guard]


@pytest.fixture
def console():
    return Console(file=io.StringIO(), width=200)


def test_all_points_are_measured_once_and_concluded_in_order(tmp_path, measured, console, here):
    ((experiment, results, section),) = run.run_experiments(
        [SQUARES], Effort.QUICK, tmp_path, console, workers=1
    )
    assert experiment is SQUARES
    assert [(row.point["x"], row.numbers["square"]) for row in results.rows] == [(0, 0), (1, 1), (2, 4)]
    assert section.findings[0].verdict is Verdict.AGREES
    assert measured() == ["0", "1", "2"]
    assert "3 points of 1 experiments\n" in console.file.getvalue()

    run.run_experiments([SQUARES], Effort.FULL, tmp_path, console, workers=1)
    assert measured() == ["3", "4"]  # a full report reuses the points of a quick report
    assert "5 points of 1 experiments, 3 of them measured before" in console.file.getvalue()

    again = run.run_experiments([SQUARES], Effort.QUICK, tmp_path, console, workers=1)
    assert measured() == []
    assert again == [(experiment, results, section)]


def test_what_was_interrupted_goes_on_where_it_stopped(tmp_path, measured, console, here, monkeypatch):
    keep, kept = Store.keep, []

    def keep_two(self, point, outcome):
        if len(kept) == 2:
            raise KeyboardInterrupt
        kept.append(point["x"])
        keep(self, point, outcome)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "keep", keep_two)
        with pytest.raises(KeyboardInterrupt):
            run.run_experiments([SQUARES], Effort.FULL, tmp_path, console, workers=1)
    assert "run the same command to resume" in console.file.getvalue()
    measured()
    ((_, results, _),) = run.run_experiments([SQUARES], Effort.FULL, tmp_path, console, workers=1)
    assert measured() == ["2", "3", "4"]
    assert [row.numbers["square"] for row in results.rows] == [0, 1, 4, 9, 16]


def test_failed_points_are_said_counted_and_tried_again(tmp_path, measured, console):
    (tmp_path / "rough").touch()
    concluded = run.run_experiments([ROUGH, CARELESS], Effort.QUICK, tmp_path, console, workers=1)
    said = console.file.getvalue()
    for name, (_, results, section) in zip(("rough", "careless"), concluded, strict=True):
        assert [row.point["x"] for row in results.failed] == [1, 2]
        assert f"failed: {name} {{'x': 1}}: ValueError: too rough" in said
        assert f"failed: {name} {{'x': 2}}: its process was lost: exit code 9" in said
        assert section.findings[0].verdict is Verdict.UNKNOWN
        assert "2 of 3 points failed" in section.findings[0].why
    (tmp_path / "rough").unlink()
    measured()
    concluded = run.run_experiments([ROUGH, CARELESS], Effort.QUICK, tmp_path, console, workers=1)
    assert measured() == ["1", "2", "1", "2"]
    assert [results.failed for _, results, _ in concluded] == [[], []]


def test_results_of_other_code_are_set_aside_and_measured_again(tmp_path, measured, console, here):
    store = Store(tmp_path / "squares.jsonl", {"sources": "another"})
    store.close()
    run.run_experiments([SQUARES], Effort.QUICK, tmp_path, console, workers=1)
    assert measured() == ["0", "1", "2"]
    (line,) = [line for line in console.file.getvalue().splitlines() if "other code" in line]
    assert str(tmp_path / "squares.another.jsonl") in line


def test_a_broken_file_is_refused_before_anything_is_measured(tmp_path, measured, console):
    (tmp_path / "rough.jsonl").write_text("what\n")
    with pytest.raises(SweepError, match=r"rough\.jsonl"):
        run.run_experiments([SQUARES, ROUGH], Effort.QUICK, tmp_path, console, workers=1)
    assert measured() == []


def test_a_conclusion_that_breaks_with_all_points_there_is_not_hidden(tmp_path, measured, console):
    store = Store(tmp_path / "careless.jsonl", run.origin("cpu"))
    for x in range(3):
        store.keep({"x": x}, run.Outcome({"cube": x**3}))
    store.close()
    with pytest.raises(KeyError):
        run.run_experiments([CARELESS], Effort.QUICK, tmp_path, console)


def test_experiments_come_in_the_order_of_the_report():
    names = list(EXPERIMENTS)
    assert [each.name for each in run.choose_experiments(names[::-1])] == names
    assert [each.name for each in run.choose_experiments([])] == names


def test_an_unknown_experiment_is_refused_with_the_names_there_are():
    with pytest.raises(OptionError, match="'nope'") as caught:
        run.choose_experiments(["leapfrog-reversal", "nope"])
    assert "leapfrog-reversal" in str(caught.value)


def test_a_folder_that_takes_no_files_is_refused(tmp_path):
    run.require_writable(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "x", Path("/proc/nowhere")):
        with pytest.raises(OptionError, match="choose another folder") as caught:
            run.require_writable(path)
        assert repr(str(path)) in str(caught.value)
