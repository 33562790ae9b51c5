"""Contact events from made-up impulses, step by step."""

from types import SimpleNamespace

import numpy as np
import pytest

from taichi_soft.contact.kernels.touches import OF_BODY, OF_COLLIDER
from taichi_soft.events.contacts import CONTACT_PAUSE, Contacts

FLOOR, PAIR, FAR_PAIR = (0, OF_COLLIDER, 0), (0, OF_BODY, 1), (2, OF_BODY, 10)
DT = 1 / 60
PAUSE = 3  # steps


class Game:
    """Steps of 1/60 s with given impulses."""

    def __init__(self, dt=DT):
        self.contacts, self.step, self.dt = Contacts(), -1, dt
        self.moving = set(range(11))
        self.bodies = {index: SimpleNamespace(is_alive=True, index=index) for index in self.moving}

    def go(self, *touched, impulse=(0.0, 0.0, 1.0)):
        self.step += 1
        began, ended = self.contacts.update(
            dict.fromkeys(touched, impulse), self.handles, self.moving, self.step, self.time, self.dt
        )
        return [(e.a.index, e.b.index) for e in began], ended

    @property
    def time(self):
        return (self.step + 1) * self.dt

    def handles(self, key):
        return self.bodies[key[0]], self.bodies[key[2]]


@pytest.fixture
def game():
    return Game()


def test_the_pause_is_three_steps_at_60_hz():
    assert pytest.approx(CONTACT_PAUSE) == PAUSE * DT


@pytest.mark.parametrize("gap", range(5))
def test_a_gap_shorter_than_the_pause_is_no_end(game, gap):
    assert game.go(PAIR) == ([(0, 1)], [])
    ends = [len(game.go()[1]) for _ in range(gap)]
    assert ends == [0, 0, 1, 0][:gap]
    assert game.go(PAIR) == ([(0, 1)] if gap >= PAUSE else [], [])


def test_a_contact_ends_with_all_its_impulse_and_the_time_from_the_first_to_the_last(game):
    game.go()
    game.go(PAIR, impulse=(1.0, 2.0, 3.0))
    game.go()
    game.go(PAIR, impulse=(0.0, -1.0, 0.5))
    game.go(), game.go()
    ended = game.go()[1][0]
    np.testing.assert_array_equal(ended.impulse, (1.0, 1.0, 3.5))
    assert ended.duration == pytest.approx(3 * DT)
    assert (ended.step, ended.time) == (6, pytest.approx(7 * DT))


def test_a_step_longer_than_the_pause_ends_it_at_once():
    game = Game(dt=0.2)
    game.go(FLOOR)
    assert len(game.go()[1]) == 1


def test_between_bodies_that_do_not_move_contact_goes_on(game):
    game.go(PAIR, FLOOR)
    game.moving -= {0, 1}
    assert not any(game.go()[1] for _ in range(20))
    game.moving |= {1}
    ended = [event for _ in range(PAUSE) for event in game.go()[1]]
    assert [(event.a.index, event.b.index) for event in ended] == [(0, 1)]
    assert ended[0].duration == pytest.approx(21 * DT)
    game.moving |= {0}
    assert game.go(FLOOR) == ([], [])


@pytest.mark.parametrize("gone", [0, 1])
def test_a_contact_with_what_was_removed_ends_in_the_next_step_and_a_newcomer_begins_another(game, gone):
    game.go(PAIR)
    old, game.bodies[gone] = game.bodies[gone], SimpleNamespace(is_alive=True, index=gone)
    old.is_alive = False
    began, ended = game.go(PAIR)
    assert began == [(0, 1)]
    assert old in (ended[0].a, ended[0].b)
    assert game.go(PAIR) == ([], [])


def test_events_of_a_step_come_in_the_order_of_indices_with_colliders_first(game):
    began, _ = game.go(FAR_PAIR, PAIR, (2, OF_BODY, 9), (3, OF_COLLIDER, 1), FLOOR)
    assert began == [(0, 0), (0, 1), (2, 9), (2, 10), (3, 1)]
    ended = [event for _ in range(PAUSE) for event in game.go()[1]]
    assert [(event.a.index, event.b.index) for event in ended] == began
