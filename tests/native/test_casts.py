"""Rays, shape casts and nearest points of the native library are those of Python, bit for bit."""

import pytest
from games import Player, lines_of
from scenes import aimed, aimed_game

pytestmark = pytest.mark.soak


@pytest.mark.guard
def test_casts_without_python_have_the_same_bits(export, play):
    calls = list(aimed_game())
    found = lines_of([play, export("aimed")], calls)
    expected = Player(aimed()).play(calls)
    assert found == expected
    told = [text.split() for text in expected if len(text.split()) == 7]
    assert {int(each[1]) for each in told} == set(range(-1, 6))  # bodies and every collider
    assert {int(each[0]) for each in told} == {-1, 0, 2}
    assert any(each[5] != "00000000" for each in told)  # overlaps at the start
