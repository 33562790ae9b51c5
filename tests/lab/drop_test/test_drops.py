"""Thirty random bodies on random courses, and the report about them."""

from dataclasses import replace

import numpy as np
import pytest

from lab.drop_test import Summary, make_case, run_cases
from lab.drop_test.case import FASTEST, LARGEST, MOST_SAG, SHAPES, SMALLEST, SOFTEST, STIFFEST
from lab.drop_test.case_runs import PER_SHAPE, batches

pytestmark = pytest.mark.soak

SEED, COUNT = 0, 30


@pytest.fixture(scope="module")
def cases():
    return [make_case(SEED, number) for number in range(COUNT)]


@pytest.fixture(scope="module")
def outcomes(cases):
    return {outcome.case.number: outcome for outcome in run_cases(cases)}


def test_cases_are_as_various_as_they_are_said_to_be(cases):
    assert {case.shape for case in cases} == set(SHAPES)
    for case in cases:
        extent = np.ptp(case.mesh.vertices, axis=0).max()
        assert SMALLEST <= case.size <= LARGEST
        assert extent == pytest.approx(case.size, rel=0.06)
        assert SOFTEST <= case.material.young <= STIFFEST
        assert case.material.density * 9.81 * case.size / case.material.young <= MOST_SAG * (1 + 1e-9)
        assert np.linalg.norm(case.velocity) <= FASTEST
        corners = case.mesh.vertices @ case.rotation.T + case.position
        assert all(solid.depth(corners) < 0 for solid in case.course)  # the body starts in free space


def test_a_case_follows_from_its_seed_and_number(cases):
    again = make_case(SEED, 7)
    np.testing.assert_array_equal(again.mesh.vertices, cases[7].mesh.vertices)
    np.testing.assert_array_equal(again.velocity, cases[7].velocity)
    assert str(again) == str(cases[7])
    assert str(make_case(SEED + 1, 7)) != str(again)


def test_worlds_hold_cases_of_one_number_of_substeps_and_every_case_once(cases):
    found = list(batches(cases))
    assert sorted(case.number for batch in found for case in batch) == list(range(COUNT))
    for batch in found:
        assert len({case.substeps for case in batch}) == 1
        assert all(sum(case.shape == shape for case in batch) <= PER_SHAPE for shape in SHAPES)


def test_nothing_goes_non_finite_gets_out_of_the_room_or_stays_in_an_obstacle(outcomes):
    """Five of them hit something faster than twice their speed of sound."""
    assert len(outcomes) == COUNT
    assert sum(outcome.case.mach > 2.0 for outcome in outcomes.values()) >= 5
    for outcome in outcomes.values():
        assert outcome.frozen_at is None, outcome
        assert outcome.out_through is None, outcome
        assert outcome.inside_of is None, outcome


def test_all_come_to_rest_and_none_inside_out(outcomes):
    for outcome in outcomes.values():
        assert outcome.rest_at is not None, outcome
        assert outcome.flipped == 0, outcome


@pytest.mark.guard
def test_a_body_knotted_by_an_impact_above_mach_two_comes_to_rest():
    """A knot of flipped tetrahedra drives itself, if nothing but the material's damping brakes it."""
    outcome = next(iter(run_cases([make_case(SEED, 459)])))
    assert outcome.case.mach > 2.0
    assert outcome.rest_at is not None


def test_a_case_ends_the_same_alone(outcomes):
    """The command repeats a case alone. Other bodies in a world do not affect the outcome."""
    alone = next(iter(run_cases([make_case(SEED, 3)])))
    among = outcomes[3]
    assert (alone.rest_at, alone.out, alone.inside, alone.speed) == (
        among.rest_at,
        among.out,
        among.inside,
        among.speed,
    )


def test_a_summary_counts_faults_and_says_how_to_repeat_the_worst(outcomes):
    sound = replace(outcomes[3], frozen_at=None, out_through=None, inside_of=None, rest_at=2.0, flipped=0)
    frozen = replace(sound, frozen_at=0.5, rest_at=None, flipped=4)
    lost = replace(sound, out=3.5, out_through="wall", rest_at=None, speed=0.25)
    summary = Summary((sound, frozen, lost, replace(lost, out=7.5)))
    assert summary.counts == {
        "non-finite": 1,
        "through the room": 2,
        "in an obstacle": 0,
        "not at rest": 2,
        "inside out": 1,
    }
    text = "\n".join(summary.lines(1))
    assert "4 cases, 1 of them sound" in text
    assert "7.5 m through the wall, still 0.25 sizes per second" in text
    assert "drop-test --seed 0 --law virial --flips recover --cases 1 --first NUMBER" in text
    rows = summary.rows()
    assert rows["counts"]["non-finite"] == 1
    assert [row["case"] for row in rows["failed"]] == [3, 3, 3]
    assert Summary((sound,)).failed == ()
