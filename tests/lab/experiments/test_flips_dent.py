"""A hard impact inverts tetrahedra."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from taichi_soft import load_mesh
from taichi_soft.core.package_data import ASSETS

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["flips-dent"]


@pytest.fixture(scope="module")
def rows():
    return list(quick_results(EXPERIMENT.name).rows)


def finding_of(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding


def numbers_of(rows, flips):
    return Results(tuple(rows)).one(flips=flips)


def test_dents_stay_low_on_the_body_and_nothing_runs_away(rows):
    numbers = numbers_of(rows, "tolerant")
    assert not numbers["frozen"]
    assert numbers["flipped_height"] < -0.3  # of a sphere of radius 1 that fell on its lower side
    assert numbers["pressed_height"] < -0.3
    mesh = load_mesh(ASSETS / "sphere.npz")
    x = np.array(numbers["pose"])
    volumes = np.linalg.det(x[mesh.tets[:, 1:]] - x[mesh.tets[:, :1]]) / 6
    assert (volumes < 0).mean() == pytest.approx(numbers["flipped"][-1], abs=0.01)
    assert volumes.sum() / mesh.volume == pytest.approx(numbers["volume"], abs=0.01)
    assert 0.4 < numbers["volume"] < 0.9


def test_before_the_first_flip_the_fall_is_too_short_for_one(rows):
    """The sphere starts 0.05 m above the floor and needs 2.5 ms at 20 m/s."""
    for row in rows:
        first = int(np.argmax(np.array(row.numbers["flipped"]) > 0))
        assert row.numbers["time"][first] > 0.05 / 20.0


def test_not_handled_it_runs_away_and_driven_back_it_is_whole(rows):
    assert numbers_of(rows, "off")["frozen"]
    recovered = numbers_of(rows, "recover")
    assert recovered["volume"] == pytest.approx(1.0, abs=0.03)
    assert recovered["flipped"][-1] == 0.0
    assert max(recovered["flipped"]) > 0.0


def test_the_verdict_follows_the_numbers(rows):
    assert finding_of(rows).verdict is Verdict.AGREES
    assert len(section_of(EXPERIMENT, Results(tuple(rows))).pictures) == 1
    changes = (
        ({"frozen": True}, Verdict.DIFFERS),
        ({"in_pressed": 0.25}, Verdict.DIFFERS),
        ({"kept": 0.1}, Verdict.DIFFERS),
        ({"flipped": [0.0, 0.0], "time": [0.0, 5.0]}, Verdict.UNKNOWN),
    )
    for change, verdict in changes:
        other = copy.deepcopy(rows)
        other[0].numbers.update(change)
        assert finding_of(other).verdict is verdict


def test_where_some_speeds_dent_what_was_pressed_and_others_do_not_the_page_cannot_tell(rows):
    elsewhere = [replace(row, point=row.point | {"speed": 30.0}) for row in copy.deepcopy(rows)]
    elsewhere[0].numbers["in_pressed"] = 0.3
    finding = finding_of([*rows, *elsewhere])
    assert finding.verdict is Verdict.UNKNOWN
    assert "at 20 m/s they stay" in finding.why
