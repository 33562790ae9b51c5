"""Joints break, and origins shift, in the native library as in Python, bit for bit."""

import pytest
from games import Player, lines_of
from scenes import breaking, breaking_game, far_game, shifted, shifted_game

pytestmark = pytest.mark.soak


@pytest.mark.guard
def test_joints_without_python_break_at_the_same_steps(export, play):
    calls = list(breaking_game())
    found = lines_of([play, export("breaking")], calls)
    expected = Player(breaking()).play(calls)
    assert found == expected
    assert {text.split()[0] for text in expected} >= {"128"}


@pytest.mark.guard
def test_a_world_without_python_has_the_same_bits_after_shifts_of_its_origin(export, play):
    calls = list(shifted_game())
    found = lines_of([play, export("shifted")], calls)
    expected = Player(shifted()).play(calls)
    assert len(set(expected)) > 100
    assert sum(text.startswith("128 0 ") for text in expected) == 1  # the attachment to frame 0 broke
    assert found == expected


@pytest.mark.guard
def test_a_world_without_python_has_the_same_bits_20_km_from_the_origin(export, play):
    calls = list(far_game())
    found = lines_of([play, export("shifted")], calls)
    expected = Player(shifted()).play(calls)
    assert len(set(expected)) > 300
    assert found == expected
