"""The accumulator of time, compared with exact arithmetic."""

import dataclasses
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_adapter import FixedStep
from engine_adapter.fixed_step import ROUND_OFF, Accumulator
from taichi_soft import OptionError

DTS = st.sampled_from([1 / 60, 1 / 50, 1 / 30, 1 / 120, 0.1, 0.25, 1e-3, 0.7])
FRAMES = st.lists(
    st.one_of(
        st.floats(0, 3, allow_subnormal=False), st.sampled_from([0.0, 1 / 144, 1 / 60, 1 / 30, 5e-324])
    ),
    max_size=60,
)


@settings(max_examples=300)
@given(DTS, st.integers(1, 9), FRAMES)
def test_steps_and_dropped_time_and_remainder_are_the_time_put_in(dt, max_steps, frames):
    accumulator = Accumulator(FixedStep(dt=dt, max_steps=max_steps))
    put_in = given_out = Fraction(0)
    for frame in frames:
        steps, dropped = accumulator.put(frame)
        assert 0 <= steps <= max_steps
        assert dropped >= 0
        assert 0 <= accumulator.alpha < 1
        put_in += Fraction(frame)
        given_out += steps * Fraction(dt) + Fraction(dropped)
        assert abs(put_in - given_out - Fraction(accumulator.remainder)) < Fraction(1e-12)


@settings(max_examples=300)
@given(st.integers(1, 200), st.integers(1, 12), st.lists(st.integers(0, 500), max_size=60))
def test_steps_are_those_of_exact_arithmetic(parts, max_steps, frames):
    """Frames are whole hundredths of a second and so is the step: each decision can be made exactly."""
    dt = parts / 100
    accumulator = Accumulator(FixedStep(dt=dt, max_steps=max_steps))
    left = Fraction(0)
    for frame in frames:
        left += frame
        expected = min(left // parts, max_steps)
        dropped = Fraction(0)
        if left // parts > max_steps:
            dropped = left - max_steps * parts
        left -= expected * parts + dropped
        steps, seconds = accumulator.put(frame / 100)
        assert steps == expected
        assert seconds == pytest.approx(float(dropped / 100), abs=1e-9)
        assert accumulator.alpha == pytest.approx(float(left / parts), abs=1e-6)


@pytest.mark.parametrize("rate", [24, 30, 50, 59.94, 60, 72, 90, 120, 144, 240, 1000 / 3])
def test_equal_frames_make_one_step_each_without_drift(rate):
    accumulator = Accumulator(FixedStep(dt=1 / rate))
    for _ in range(10_000):
        assert accumulator.put(1 / rate) == (1, 0.0)
        assert accumulator.alpha < 1e-9


def test_a_60_hz_simulation_on_a_144_hz_screen():
    """Twelve frames are five steps, for an hour; alpha walks through twelve values."""
    accumulator = Accumulator(FixedStep(dt=1 / 60))
    steps, alphas = 0, []
    for frame in range(1, 144 * 3600 + 1):
        steps += accumulator.put(1 / 144)[0]
        if frame % 12 == 0 and frame < 144:
            assert steps * 12 == frame * 5
        alphas.append(accumulator.alpha)
    assert steps == 60 * 3600
    expected = [frame * 5 % 12 / 12 for frame in range(1, 13)]
    assert alphas[:12] == pytest.approx(expected, abs=1e-12)
    assert alphas[-12:] == pytest.approx(expected, abs=1e-6)


def test_a_60_hz_simulation_on_a_30_hz_screen_makes_two_steps_a_frame():
    accumulator = Accumulator(FixedStep(dt=1 / 60))
    assert {accumulator.put(1 / 30) for _ in range(10_000)} == {(2, 0.0)}


def test_irregular_frames_lose_nothing():
    accumulator = Accumulator(FixedStep(dt=1 / 60))
    steps = [accumulator.put(frame)[0] for frame in (0.010, 0.010, 0.0, 0.030, 0.050)]
    assert steps == [0, 1, 0, 2, 3]
    assert accumulator.remainder == pytest.approx(0.1 - 6 / 60, abs=1e-15)


def test_as_many_steps_as_allowed_drop_nothing():
    accumulator = Accumulator(FixedStep(dt=0.25, max_steps=4))
    assert accumulator.put(1.125) == (4, 0.0)
    assert accumulator.alpha == 0.5


def test_one_step_too_many_drops_the_whole_rest():
    accumulator = Accumulator(FixedStep(dt=0.25, max_steps=4))
    assert accumulator.put(0.125) == (0, 0.0)
    assert accumulator.put(1.25) == (4, 0.375)
    assert accumulator.alpha == 0.0


@pytest.mark.parametrize("frame", [1e6, 1e300, 1.7e308])
def test_a_frame_of_any_length_makes_max_steps(frame):
    accumulator = Accumulator(FixedStep(dt=1e-3, max_steps=3))
    steps, dropped = accumulator.put(frame)
    assert steps == 3
    assert dropped == pytest.approx(frame)
    assert accumulator.remainder == 0.0


def test_round_off_is_forgiven_and_not_more():
    forgiven = Accumulator(FixedStep(dt=1.0))
    assert forgiven.put(1.0 - ROUND_OFF / 2)[0] == 1
    assert forgiven.alpha == 0.0
    assert forgiven.remainder < 0.0
    assert forgiven.put(1.0)[0] == 1
    assert Accumulator(FixedStep(dt=1.0)).put(1.0 - 2 * ROUND_OFF)[0] == 0


def test_defaults():
    assert FixedStep() == FixedStep(dt=1 / 60, substeps=None, max_steps=8)


def test_a_fixed_step_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        FixedStep().dt = 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("dt", value) for value in (0, -1 / 60, float("nan"), float("inf"), "1/60", None, True, [1.0])]
    + [("substeps", value) for value in (0, -1, 1.5, True, "4")]
    + [("max_steps", value) for value in (0, -1, 8.0, None, False)],
)
def test_bad_values_are_refused_by_name(name, value):
    with pytest.raises(OptionError, match=name):
        FixedStep(**{name: value})
