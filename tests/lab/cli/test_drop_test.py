"""The command `drop-test`: random cases with a law, and the sweep."""

import json
import subprocess
import sys

import pytest

from lab import drop_test as drops
from lab.cli import main

pytestmark = [pytest.mark.soak, pytest.mark.guard]


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ((), ("virial", None)),
        (("--law", "neo_hookean"), ("neo_hookean", None)),
        (("--law", "face", "--flips", "tolerant"), ("face", "tolerant")),
    ],
)
def test_law_and_flips_reach_the_cases(monkeypatch, given, wanted):
    asked, run, make_case = [], [], drops.make_case

    def make(*case):
        asked.append(case)
        return make_case(*case)

    def run_none(cases):
        run.extend(cases)
        return iter(())

    monkeypatch.setattr(drops, "make_case", make)
    monkeypatch.setattr(drops, "run_cases", run_none)
    with pytest.raises(SystemExit) as end:
        main("drop-test", "--cases", "2", *given)
    assert end.value.code == 0
    assert asked == [(0, 0, *wanted), (0, 1, *wanted)]
    assert {case.law for case in run} == {wanted[0]}


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (("--law", "nope"), "'nope'"),
        (("--only", "own"), "--sweep"),
        (("--sweep", "--only", "nope"), "'nope'"),
        (("--sweep", "--law", "springs"), "'springs'"),
        (("--sweep", "--damping", "nope"), "'nope'"),
        (("--sweep", "--first", "3"), "--first"),
    ],
)
def test_a_wrong_choice_is_refused_by_name(capsys, tmp_path, monkeypatch, given, named):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main("drop-test", "--cases", "1", *given)
    assert end.value.code == 1
    assert named in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_sweep_keeps_what_it_computed_and_computes_nothing_twice(tmp_path):
    command = [
        *(sys.executable, "-m", "lab", "drop-test", "--sweep", "--only", "own", "--cases", "1"),
        *("--law", "neo_hookean", "--damping", "edges 0.2", "--workers", "1"),
    ]
    first = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert first.returncode == 0, first.stderr
    assert "1 points of 1 experiments\n" in first.stderr
    kept = (tmp_path / "out/sweep/own.jsonl").read_text().splitlines()
    assert [json.loads(line)["numbers"]["verdict"] for line in kept[1:]] == ["ok"]
    again = subprocess.run([*command, "--json"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert "1 of them measured before" in again.stderr
    assert [row["name"] for row in json.loads(again.stdout)] == [json.loads(kept[1])["point"]["name"]]
    assert (tmp_path / "out/sweep/own.jsonl").read_text().splitlines() == kept
    page = (tmp_path / "out/sweep/sweep.md").read_text()
    assert "| own | neo\\_hookean | recover | edges 0.2 | 1 |" in page
