"""Waiting requests: merged for each visitor. Visitors alternate, and each gets a part of the time."""

from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("websockets", reason="needs websockets: pip install 'taichi-soft[live]'")

from taichi_soft.live.inbox import BURST, LONGEST_WAIT, MOST_WAITING, SERVER, SHARE, Inbox


def drained(inbox, now=float("inf")):
    """Return all messages that can be read now."""
    found = []
    while (taken := inbox.take(now)) is not None:
        found.append(taken)
    return found


def test_a_merged_queue_ends_in_the_state_that_all_requests_in_their_order_lead_to():
    rng = np.random.default_rng(7)

    def played(messages):
        """A model of the world: values that requests overwrite, a reset, and an order that counts."""
        values, order = {}, []
        for name, *rest in messages:
            if name == "set":
                values[rest[0]] = rest[1]
            elif name == "reset":
                values.clear()
            else:
                order.append((name, *rest, tuple(sorted(values.items()))))
        return values, order

    for _ in range(300):
        inbox, sent = Inbox(), []
        for number in range(int(rng.integers(1, 40))):
            kind = rng.choice(["a", "b", "reset", "spawn"], p=[0.4, 0.3, 0.2, 0.1])
            message = {"spawn": ("spawn", number), "reset": ("reset",)}.get(kind, ("set", kind, number))
            sent.append(message)
            assert inbox.put(1, message, key=None if kind == "spawn" else kind)
        taken = [message for _, message in drained(inbox)]
        assert played(taken) == played(sent)
        segments = 1 + sum(message[0] == "spawn" for message in sent)
        assert len(taken) <= 3 * segments + segments - 1


def test_the_newest_of_each_kind_is_left_of_a_flood_and_what_cannot_be_merged_is_bounded():
    inbox = Inbox()
    for number in range(10_000):
        assert inbox.put(1, ("set", "young", number), key="young")
    assert drained(inbox) == [(1, ("set", "young", 9999))]
    accepted = sum(inbox.put(1, ("spawn", number)) for number in range(1000))
    assert accepted == MOST_WAITING
    assert inbox.put(1, ("release",), is_kept=True)
    assert inbox.put(2, ("spawn", 0)), "another visitor has room of its own"


def test_what_a_visitor_has_waiting_goes_when_it_leaves():
    inbox = Inbox()
    for number in range(MOST_WAITING):
        assert inbox.put(1, ("spawn", number))
    assert inbox.put(2, ("step",))
    assert inbox.put(1, ("leave",), is_last=True)
    assert sorted(drained(inbox)) == [(1, ("leave",)), (2, ("step",))]


def test_visitors_take_turns_whoever_sent_more_and_the_server_comes_first():
    inbox = Inbox()
    for number in range(50):
        inbox.put(1, ("spawn", number))
    for number in range(3):
        inbox.put(2, ("step", number))
        inbox.put(SERVER, ("pause", number))
    senders = [sender for sender, _ in drained(inbox)]
    assert senders[:3] == [SERVER] * 3
    assert sorted(senders[3:9]) == [1, 1, 1, 2, 2, 2]
    assert all(a != b for a, b in pairwise(senders[3:9]))


@pytest.mark.parametrize("flooding", [1, 3])
def test_floods_take_their_share_of_the_time_together_and_a_quiet_visitor_is_served_at_once(flooding):
    inbox, now, busy, waits, cost = Inbox(), 0.0, 0.0, [], 0.02
    for tick in range(6000):
        for sender in range(1, flooding + 1):
            inbox.put(sender, ("reset",), key="reset")
        if tick % 100 == 0:
            inbox.put(99, ("grab", now))
        while (taken := inbox.take(now)) is not None:
            sender, message = taken
            if sender == 99:
                waits.append(now - message[1])
                continue
            now += cost
            busy += cost
            inbox.charge(sender, now, cost)
        now += 0.01
    assert busy / now == pytest.approx(SHARE, rel=0.15)
    assert max(waits) <= 0.01 + flooding * (BURST * SHARE + cost)


def test_the_wait_after_an_expensive_request_is_limited():
    inbox = Inbox()
    inbox.charge(1, 10.0, 60.0)
    inbox.put(1, ("release",))
    assert inbox.take(10.0) is None
    assert inbox.take(10.0 + LONGEST_WAIT + 1e-9) == (1, ("release",))
