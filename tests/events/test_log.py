"""The event log and its listeners, with made-up events."""

import pytest

from taichi_soft import (
    ContactBegan,
    ContactEnded,
    Event,
    FellAsleep,
    Froze,
    OptionError,
    StateError,
    StressExceeded,
    Woke,
)
from taichi_soft.events import EventLog
from taichi_soft.events.log import MAX_EVENTS


class Script:
    """A fake observer that reports in each step that body 0 falls asleep and body 1 wakes."""

    has_contacts = True
    lost_touches = False

    def __init__(self, times=1):
        self.times = times

    def begin(self, kinds, before):
        self.kinds = kinds

    def events(self, kinds, step, time, dt):
        for _ in range(self.times):
            yield FellAsleep(step, time, 0)
            yield Woke(step, time, 1)


@pytest.fixture
def observer():
    return Script()


@pytest.fixture
def log(observer):
    return EventLog(observer)


def told(events):
    return [(event.step, type(event)) for event in events]


def both(*steps):
    return [(step, kind) for step in steps for kind in (FellAsleep, Woke)]


def test_all_events_since_the_last_drain_come_once_and_step_by_step(log):
    log.record([Event])
    log.collect(0, 0.1, 0.1)
    log.collect(1, 0.2, 0.1)
    assert told(log.drain()) == both(0, 1)
    assert log.drain() == []
    log.collect(2, 0.3, 0.1)
    assert told(log.drain()) == both(2)


def test_only_the_kinds_asked_for_are_recorded(log, observer):
    log.record([Woke, ContactEnded])
    log.collect(0, 0.1, 0.1)
    assert told(log.drain()) == [(0, Woke)]
    assert observer.kinds == {Woke, ContactEnded}
    log.record([])
    log.collect(1, 0.2, 0.1)
    assert log.drain() == []
    log.record((Event,))
    assert len(observer.kinds) == 12


def test_listeners_hear_only_within_drain_and_only_of_their_kind(log):
    heard = []
    log.on(Woke, lambda event: heard.append(("woke", event.step)))
    log.collect(0, 0.1, 0.1)
    log.on(Event, lambda event: heard.append((type(event).__name__, event.step)))
    log.collect(1, 0.2, 0.1)
    assert heard == []
    assert told(log.drain()) == [(0, Woke), *both(1)]
    expected = [("woke", 0), ("Woke", 0), ("FellAsleep", 1), ("woke", 1), ("Woke", 1)]
    assert heard == expected
    log.drain()
    assert heard == expected


def test_a_removed_listener_hears_nothing_more_even_of_what_waits(log):
    heard = []
    first = log.on(Woke, lambda event: (heard.append("first"), second.remove()))
    second = log.on(Woke, lambda event: heard.append("second"))
    log.collect(0, 0.1, 0.1)
    log.drain()
    first.remove()
    first.remove()
    log.collect(1, 0.2, 0.1)
    assert told(log.drain()) == [(1, Woke)]
    assert heard == ["first"]


def test_a_listener_may_step_the_world_and_add_listeners_who_hear_of_what_comes_later(log):
    heard = []

    def step_on(event):
        heard.append(event.step)
        if event.step == 0:
            log.collect(1, 0.2, 0.1)
            log.on(Woke, lambda event: heard.append(("late", event.step)))

    log.on(Woke, step_on)
    log.collect(0, 0.1, 0.1)
    assert told(log.drain()) == [(0, Woke)]
    assert heard == [0]
    assert told(log.drain()) == [(1, Woke)]
    assert heard == [0, 1, ("late", 1)]


def test_an_exception_of_a_listener_keeps_nothing_from_the_others_and_no_event_is_lost_or_told_twice(log):
    heard = []

    def fail(event):
        raise ZeroDivisionError(f"in step {event.step}")

    def fail_too(event):
        raise KeyError(event.step)

    log.on(Event, fail)
    log.on(Event, fail_too)
    log.on(Event, lambda event: heard.append((event.step, type(event))))
    log.collect(0, 0.1, 0.1)
    with pytest.raises(ZeroDivisionError, match="in step 0"):
        log.drain()
    assert heard == both(0)
    log.collect(1, 0.2, 0.1)
    with pytest.raises(ZeroDivisionError, match="in step 1"):
        log.drain()
    assert heard == both(0, 1)
    assert told(log.drain()) == both(0, 1)
    assert log.drain() == []


def test_a_listener_cannot_drain_and_the_log_goes_on(log):
    log.on(Woke, lambda event: log.drain())
    log.collect(0, 0.1, 0.1)
    with pytest.raises(StateError, match="by a listener"):
        log.drain()
    assert told(log.drain()) == [(0, Woke)]


def test_memory_is_bounded_by_dropping_the_oldest_with_one_word_per_drain(log, observer):
    observer.times = MAX_EVENTS // 4
    log.record([Event])
    assert [log.collect(step, step, 1.0) for step in range(2)] == ["", ""]
    assert "10,000 events" in log.collect(2, 2.0, 1.0)
    assert log.collect(3, 3.0, 1.0) == ""
    assert log.dropped == MAX_EVENTS
    events = log.drain()
    assert len(events) == MAX_EVENTS
    assert (events[0].step, events[-1].step) == (2, 3)
    observer.times = MAX_EVENTS
    assert "drain_events" in log.collect(4, 4.0, 1.0)
    assert log.dropped == 2 * MAX_EVENTS


def test_listeners_hear_of_what_follows_dropped_events(log, observer):
    """An event that was reported, stored after a failure and then dropped does not replace other reports."""
    heard = []

    def fail_once(event):
        heard.append(event.step)
        if event.step == 0:
            raise KeyError

    log.on(Event, fail_once)
    log.collect(0, 0.0, 1.0)
    with pytest.raises(KeyError):
        log.drain()
    observer.times = MAX_EVENTS // 2
    log.collect(1, 1.0, 1.0)
    assert len(log.drain()) == MAX_EVENTS
    assert heard == [0, 0] + MAX_EVENTS * [1]


def test_pairs_without_room_are_reported(log, observer):
    log.record([ContactBegan])
    observer.lost_touches = True
    assert "more pairs of bodies" in log.collect(0, 0.1, 0.1)
    assert log.collect(1, 0.2, 0.1) == ""
    log.drain()
    assert log.collect(2, 0.3, 0.1) != ""


@pytest.mark.parametrize("kinds", [None, 1, "Woke", Woke, [None], [Woke(0, 0.0, 0)], [int], [Woke, "x"]])
def test_what_is_no_list_of_kinds_is_refused_and_changes_nothing(log, kinds):
    log.record([Froze])
    log.collect(0, 0.1, 0.1)
    with pytest.raises(OptionError, match="class"):
        log.record(kinds)
    log.collect(1, 0.2, 0.1)
    assert log.drain() == []


def test_other_refusals(log, observer):
    class Mine(Event):
        pass

    with pytest.raises(StateError, match="record_events"):
        log.drain()
    for kind in (Mine, None, "Woke"):
        with pytest.raises(OptionError, match="class of events"):
            log.on(kind, print)
    with pytest.raises(OptionError, match="callable"):
        log.on(Woke, 3)
    observer.has_contacts = False
    for kind in (ContactBegan, ContactEnded):
        with pytest.raises(StateError, match="per_body"):
            log.on(kind, print)
    with pytest.raises(StateError, match="record_events"):
        log.drain()
    log.on(StressExceeded, print)
    log.record([Event])
    assert observer.kinds.isdisjoint({ContactBegan, ContactEnded})
