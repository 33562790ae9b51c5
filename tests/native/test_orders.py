"""Games with unusual orders of calls: the native library and Python still agree."""

import pytest
from games import Player, line, lines_of
from scenes import DT, GAMES, UPRIGHT, turn

pytestmark = [pytest.mark.soak, pytest.mark.guard]


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


def a_load_that_one_of_two_frames_feels():
    """Slot 1 has been attached to frame 0 since the export, and frame 0 feels its force."""
    yield line("add_frame", (3.0, 0.0, 1.0), UPRIGHT)
    for i in range(90):
        if i == 5:
            yield line("attach", 1, [10, 11], 1, 0)
        if i == 10:
            yield line("snapshot")
        if i in (15, 35):
            yield line("load", 1, 0)
            yield line("detach", 1, [0, 1, 2, 3])
        if i == 30:
            yield line("restore")
        if i == 40:
            yield line("attach", 0, [0, 1, 9], 0, 1)  # some of them pinned before
            yield line("attach", 0, [12], 1, 1)
        if i == 45:
            yield line("load", 0, 0)
            yield line("detach", 0, [0, 1, 9])
        if i == 50:
            yield line("load", 0, 1)
            yield line("remove_frame", 1)
        if i == 60:
            yield line("restore")
            yield line("despawn", 1)
        if i == 70:
            yield line("spawn", 1, (0.0, 0.5, 1.0), UPRIGHT, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            yield line("attach", 1, [0, 1], 1, 0)
        if i == 80:
            yield line("detach", 1, [])
        yield line("move_frame", 0, (0.002 * i, 0.5, 1.0), turn((0, 1, 0), 0.003 * i))
        yield line("step", DT, 0)


ORDERS = {"heap": sleep_that_is_asked_for_after_a_restore, "free": a_load_that_one_of_two_frames_feels}


@pytest.mark.parametrize("name", ORDERS)
def test_an_odd_order_has_the_same_bits(name, export, play):
    calls = list(ORDERS[name]())
    found = lines_of([play, export(name)], calls)
    assert found == Player(GAMES[name][0]()).play(calls)
