"""The real-time factor of the thesis's sphere. No test asserts a duration."""

import copy

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.sphere_real_time import nanoseconds, real_time_factor

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["sphere-real-time"]


@pytest.fixture(scope="module")
def row():
    (row,) = quick_results(EXPERIMENT.name).rows
    return row


def finding_of(row):
    (finding,) = section_of(EXPERIMENT, Results((row,))).findings
    return finding


def test_it_is_timed_alone_and_all_of_the_fall_and_bounce_is(row):
    assert EXPERIMENT.is_timing
    assert len(row.numbers["frames"]) * 0.02 == pytest.approx(row.point["seconds"])
    assert min(row.numbers["frames"]) > 0
    assert row.numbers["tets"] == 968
    assert not row.numbers["frozen"]


def test_the_factor_and_the_cost_of_a_tetrahedron():
    """The thesis: 955 tetrahedra, 700 steps a second at 45 % of real time: 3.3 microseconds each."""
    assert real_time_factor({"frames": [0.01, 0.03]}) == pytest.approx(1.0)
    assert nanoseconds(0.45, 955) == pytest.approx(1e9 / (955 * 700 * 0.45))


def test_a_rate_here_says_nothing_of_a_processor_of_2002_and_the_finding_says_so(row):
    fast, broken = (copy.deepcopy(row) for _ in range(2))
    fast.numbers["frames"] = [0.01] * 10
    broken.numbers["frozen"] = True
    assert finding_of(fast).verdict is finding_of(broken).verdict is Verdict.UNKNOWN
    assert finding_of(fast).measured.startswith("2 times real time here")
    assert "4.44 times the thesis's 0.45" in finding_of(fast).measured
    assert "AMD XP 1800+" in finding_of(fast).why
    assert "non-finite" in finding_of(broken).why
