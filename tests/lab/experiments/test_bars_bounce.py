"""Crossed bars that bend on the floor and vibrate in flight."""

import copy

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.bars_bounce import DT, bars_mesh, bending, flight_of, frequency_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["fig-6.2"]


@pytest.fixture(scope="module")
def row():
    (row,) = quick_results(EXPERIMENT.name).rows
    return row


def verdict_of(row):
    (finding,) = section_of(EXPERIMENT, Results((row,))).findings
    return finding.verdict


def test_before_the_impact_and_in_flight_it_falls_as_a_stone(row):
    """Drop of 1.5 m: sqrt(2 h / g); in both phases the centre has the acceleration of gravity."""
    touched, lift, end = flight_of(row.numbers)
    assert touched * DT == pytest.approx(np.sqrt(2 * 1.5 / 9.81), abs=0.02)
    time, height = np.array(row.numbers["time"]), np.array(row.numbers["center"])
    for phase in (slice(0, touched - 1), slice(lift + 1, end - 1)):
        assert 2 * np.polyfit(time[phase], height[phase], 2)[0] == pytest.approx(-9.81, rel=0.01)
    assert end - lift > 0.3 / DT


def test_nothing_vibrates_before_the_impact_and_much_after(row):
    touched, lift, end = flight_of(row.numbers)
    impact = 9.81 * 1.5 * 1000 * 0.296  # m g h: 37 cells of 0.2 m
    assert row.numbers["kinetic"][touched - 1] == pytest.approx(impact, rel=0.05)
    assert max(map(abs, row.numbers["vibration"][: touched - 1])) < 1e-4 * impact
    assert max(row.numbers["vibration"][lift:end]) > 0.03 * impact


def test_deflection_of_bars_bent_into_arcs():
    """Each half bar an arc of 0.6 rad from where the crossing ends, turned as a whole."""
    mesh = bars_mesh()
    x, bent = mesh.vertices, mesh.vertices.copy()
    reach = np.clip(np.abs(x[:, 0]) - 0.1, 0.0, None)
    radius = 1.2 / 0.6
    arm = reach > 0
    bent[arm, 0] = np.sign(x[arm, 0]) * (0.1 + (radius - x[arm, 2]) * np.sin(reach[arm] / radius))
    bent[arm, 2] = radius - (radius - x[arm, 2]) * np.cos(reach[arm] / radius)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    deflection, change = bending(mesh, bent @ turn.T + 3.0)
    assert deflection == pytest.approx(radius * (1 - np.cos(0.6)), rel=1e-3)
    assert change < 2e-3


def test_frequency_of_a_swing():
    time = np.arange(0, 0.6, DT)
    assert frequency_of(list(np.sin(2 * np.pi * 3.5 * time) ** 2)) == pytest.approx(3.5, rel=0.05)


def test_the_verdict_follows_the_numbers_and_there_are_pictures(row):
    assert verdict_of(row) is Verdict.AGREES
    assert len(section_of(EXPERIMENT, Results((row,))).pictures) == 4
    still, stiff = copy.deepcopy(row), copy.deepcopy(row)
    still.numbers["vibration"] = [0.001 * each for each in row.numbers["vibration"]]
    stiff.numbers["bend"] = [0.01 * each for each in row.numbers["bend"]]
    assert verdict_of(still) is verdict_of(stiff) is Verdict.DIFFERS
