"""Games that do things in an order in which nobody would: the native library and Python still agree."""

import pytest
from games import Player, line, lines_of
from scenes import DT, GAMES


def sleep_that_is_asked_for_after_a_restore():
    """Some sleep at the snapshot, and nobody hears of it before: nothing is told of those."""
    yield line("record_events", 3)
    for i in range(840):
        if i == 780:
            yield line("snapshot")
            yield line("record_events", 31)
        if i in (800, 820):
            yield line("drain")
            yield line("restore")
        if i == 825:
            yield line("impulse", 0, (0.0, 0.0, 20.0), [])
        yield line("step", DT, 0)
    for slot in (0, 1, 2, 5, 6, 7):
        yield line("status", slot)
    yield line("drain")


ORDERS = {"heap": sleep_that_is_asked_for_after_a_restore}


@pytest.mark.parametrize("name", ORDERS)
def test_an_odd_order_has_the_same_bits(name, export, play):
    calls = list(ORDERS[name]())
    found = lines_of([play, export(name)], calls)
    assert found == Player(GAMES[name][0]()).play(calls)
