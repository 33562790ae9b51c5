"""Events of a world, compared with the states of its bodies and colliders after each step."""

import warnings

import numpy as np
import pytest
from thread_scenes import motion, thrown

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    ContactBegan,
    ContactEnded,
    DroppedEventsWarning,
    Event,
    FellAsleep,
    Froze,
    FrozenBodyWarning,
    Material,
    SoftBodyAsset,
    SphereShape,
    StateError,
    StressExceeded,
    Woke,
    box,
    sphere,
)
from taichi_soft.events import log
from taichi_soft.world.bare import bare_world

DT = 1 / 60
STEPS = 4
PAUSE = 3  # steps without impulse after which a contact is over
BALL, CUBE = sphere(0.5, 2), box(cells=(2, 2, 2))
RUBBER = Material(3e5, 0.2, 1000.0, 2.0)
BOUNCY, DULL = SoftBodyAsset(BALL, RUBBER), SoftBodyAsset(CUBE, Material(3e5, 0.2, 1000.0, 300.0))


@pytest.fixture(scope="module")
def level():
    """A floor that is a collider, room for an obstacle, for two balls that bounce and a cube that rests."""
    world = bare_world(collider_room=1, sleep_speed=0.02)
    world.reserve(BOUNCY, 2)
    world.reserve(DULL, 1)
    world.build()
    return world


@pytest.fixture
def world(level):
    """Return the level without bodies and without recorded events."""
    world = level
    world.record_events()
    for body in world.bodies:
        world.despawn(body)
    for collider in world.colliders:
        if collider is not world.floor_collider:
            collider.remove()
    world.step(DT, STEPS)
    world.drain_events()
    world.record_events([])
    return world


def advance(world, count=1):
    for _ in range(count):
        world.step(DT, STEPS)


def test_a_bouncing_ball_begins_and_ends_one_contact_per_bounce(world):
    """Against a watcher of the floor's impulse, and Newton's second law for the ball."""
    ball = world.spawn(BOUNCY, position=(0, 0, 1.2))
    weight = ball.masses.sum() * 9.80665
    world.record_events()
    floor = world.floor_collider
    first = world.step_count
    impulses, momenta = [], [ball.momentum()[2]]
    for _ in range(150):
        advance(world)
        impulses.append(floor.impulse)
        momenta.append(ball.momentum()[2])
    touches = np.flatnonzero(np.any(impulses, axis=1))
    bounces = np.split(touches, np.flatnonzero(np.diff(touches) > PAUSE) + 1)
    assert len(bounces) >= 3
    events = world.drain_events()
    began = [event for event in events if isinstance(event, ContactBegan)]
    ended = [event for event in events if isinstance(event, ContactEnded)]
    assert len(began) + len(ended) == len(events)
    assert {(event.a, event.b) for event in events} == {(ball, floor)}
    assert [event.step - first for event in began] == [rows[0] for rows in bounces]
    still_open = bounces[-1][-1] + PAUSE >= 150
    assert [event.step - first for event in ended] == [
        rows[-1] + PAUSE for rows in (bounces[:-1] if still_open else bounces)
    ]
    for event, rows in zip(began, bounces, strict=True):
        np.testing.assert_allclose(event.impulse, impulses[rows[0]], rtol=1e-6)
    for event, rows in zip(ended, bounces, strict=False):
        begin, end = rows[0], rows[-1] + 1
        assert event.duration == pytest.approx((end - begin) * DT)
        np.testing.assert_allclose(event.impulse, np.sum(impulses[begin:end], axis=0), rtol=1e-6)
        gained = momenta[end] - momenta[begin] + weight * event.duration
        assert -event.impulse[2] == pytest.approx(gained, rel=0.01)


def test_a_resting_body_touches_until_it_is_lifted(world):
    cube = world.spawn(DULL, position=(0, 0, 0.5))
    world.record_events([ContactBegan, ContactEnded])
    advance(world, 240)
    assert [type(event) for event in world.drain_events()] == [ContactBegan]
    assert cube.is_asleep
    lifted = cube.positions() + np.float32([0, 0, 5])
    cube.set_motion(lifted, np.zeros_like(lifted))
    advance(world, PAUSE)
    ended = world.drain_events()
    assert [type(event) for event in ended] == [ContactEnded]
    assert ended[0].step == world.step_count - 1
    assert ended[0].duration == pytest.approx(240 * DT, abs=2 * DT)


def test_what_touches_when_recording_begins_begins_then(world):
    world.spawn(BOUNCY, position=(0, 0, 0.5))
    advance(world, 60)
    world.record_events([ContactBegan])
    advance(world)
    assert [event.step for event in world.drain_events()] == [world.step_count - 1]
    advance(world, 10)
    assert world.drain_events() == []


def test_contacts_of_removed_bodies_and_colliders_end_and_slots_are_not_mixed_up(world):
    obstacle = world.add_collider(SphereShape(0.5), position=(0, 0, 0.5))
    old = world.spawn(BOUNCY, position=(0, 0, 1.5))
    world.record_events([ContactBegan, ContactEnded])
    advance(world)
    assert [(event.a, event.b) for event in world.drain_events()] == [(old, obstacle)]
    world.despawn(old)
    new = world.spawn(BOUNCY, position=(0, 0, 1.5))
    assert new.index == old.index
    advance(world)
    assert [(type(e), e.a, e.b) for e in world.drain_events()] == [
        (ContactBegan, new, obstacle),
        (ContactEnded, old, obstacle),
    ]
    obstacle.remove()
    again = world.add_collider(SphereShape(0.5), position=(0, 0, 0.45))
    assert again.index == obstacle.index
    advance(world, 30)
    events = world.drain_events()
    assert [(type(e), e.b) for e in events[:2]] == [(ContactEnded, obstacle), (ContactBegan, again)]


def test_sleep_and_waking_are_told_of_in_their_steps_and_end_no_contact(world):
    one = world.spawn(DULL, position=(0, 0, 0.5))
    world.spawn(BOUNCY, position=(30, 0, 3), velocity=(0, 0, 5))
    world.record_events()
    first, was_asleep, seen = world.step_count, False, []

    def go(count):
        nonlocal was_asleep
        for _ in range(count):
            advance(world)
            if one.is_asleep != was_asleep:
                was_asleep = one.is_asleep
                seen.append((world.step_count - 1, FellAsleep if was_asleep else Woke, one))

    go(140)
    one.apply_impulse((0, 0, 0.1))
    go(3)
    assert not one.is_asleep
    assert [kind for _, kind, _ in seen] == [FellAsleep, Woke]
    events = world.drain_events()
    assert [(e.step, type(e), e.body) for e in events if isinstance(e, (FellAsleep, Woke))] == seen
    assert [(e.step, type(e)) for e in events if getattr(e, "a", None) is one] == [(first, ContactBegan)]


def test_what_sleeps_is_told_of_only_when_it_falls_asleep_and_who_takes_its_slot_does_not_wake(world):
    one = world.spawn(DULL, position=(0, 0, 0.5))
    advance(world, 140)
    assert one.is_asleep
    world.record_events([FellAsleep, Woke])
    advance(world)
    world.despawn(one)
    assert world.spawn(DULL, position=(0, 0, 3)).index == one.index
    advance(world)
    assert world.drain_events() == []


def test_a_frozen_body_is_told_of_in_the_step_that_was_undone_also_where_warnings_are_errors(world):
    sound = world.spawn(BOUNCY, position=(0, 0, 0.5))
    lost = world.spawn(BOUNCY, position=(3, 0, 3))
    heard = []
    world.on(Froze, heard.append)
    rows = np.ones((lost.vertex_count, 3))
    lost.set_motion(9.9999e6 * rows, 1.9e4 * rows)
    with pytest.warns(FrozenBodyWarning):
        advance(world)
    advance(world)
    assert heard == []
    events = world.drain_events()
    assert [(e.step, e.body) for e in events] == [(world.step_count - 2, lost)]
    assert heard == events
    assert events[0].failure == lost.failure
    assert events[0].failure.step == events[0].step
    lost.set_motion(9.9999e6 * rows, 1.9e4 * rows)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(FrozenBodyWarning):
            advance(world)
    assert [e.body for e in world.drain_events()] == [lost]
    assert not sound.is_frozen


def test_a_frame_of_several_fixed_steps_gives_the_events_of_all(world):
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=STEPS, max_steps=8))
    low = world.spawn(BOUNCY, position=(0, 0, 0.505), velocity=(0, 0, -0.5))
    high = world.spawn(BOUNCY, position=(3, 0, 0.55), velocity=(0, 0, -1))
    world.record_events([ContactBegan])
    first = world.step_count
    assert adapter.advance(6.5 * DT) == 6
    events = adapter.drain_events()
    assert [event.a for event in events] == [low, high]
    assert first <= events[0].step < events[1].step < first + 6
    assert events[1].time == pytest.approx(world.time - DT * (world.step_count - 1 - events[1].step))


def test_too_many_events_are_dropped_with_a_warning_in_the_step(world, monkeypatch):
    monkeypatch.setattr(log, "MAX_EVENTS", 2)
    world.record_events([ContactBegan])
    before = world.dropped_events
    for i in range(2):
        world.spawn(BOUNCY, position=(3 * i, 0, 0.5))
    obstacle = world.add_collider(SphereShape(0.5), position=(0, 0, 1.45))
    with pytest.warns(DroppedEventsWarning, match="drain_events"):
        advance(world)
    assert world.dropped_events == before + 1
    assert {event.b for event in world.drain_events()} == {world.floor_collider, obstacle}


@pytest.fixture(scope="module")
def collision():
    """Throw twelve bodies at each other. Return final states bit by bit, momentum gains and events."""
    world, gained, events = thrown()
    return motion(world), gained, events


def test_each_body_gains_the_momentum_that_its_contacts_gave_it(collision):
    _, gained, events = collision
    ended = [event for event in events if isinstance(event, ContactEnded)]
    began = [(event.a, event.b) for event in events if isinstance(event, ContactBegan)]
    assert len(began) == len(ended), "some still touch: let them fly apart for longer"
    assert len(set(began)) > 15
    assert all(a.index < b.index for a, b in began)
    given = np.zeros_like(gained)
    for event in ended:
        given[event.a.index] -= event.impulse
        given[event.b.index] += event.impulse
    scale = np.abs(gained).max()
    np.testing.assert_allclose(given, gained, atol=1e-5 * scale)
    assert np.abs(gained).max(axis=1).min() > 0.01 * scale


def test_events_of_a_step_come_by_kind_and_then_by_bodies(collision):
    events = collision[2]
    kinds = [ContactBegan, ContactEnded, StressExceeded]
    keys = []
    for event in events:
        who = (event.body.index, -1) if isinstance(event, StressExceeded) else (event.a.index, event.b.index)
        keys.append((event.step, kinds.index(type(event)), *who))
    assert {key[1] for key in keys} == {0, 1, 2}
    assert keys == sorted(set(keys))


def test_recording_does_not_change_the_motion(collision):
    world, _, events = thrown(recorded=False)
    assert motion(world) == collision[0]
    assert events == []


def test_a_flat_world_sees_no_contacts_and_nothing_is_seen_before_build():
    world = bare_world(schedule="flat")
    world.add_body(box(cells=(1, 1, 1)), RUBBER, position=(0, 0, 0.5))
    for call in (world.record_events, world.drain_events, lambda: world.on(Event, print)):
        with pytest.raises(StateError, match="build"):
            call()
    with pytest.raises(StateError, match="build"):
        world.dropped_events  # noqa: B018
    world.build()
    with pytest.raises(StateError, match="per_body"):
        world.record_events([ContactBegan])
    with pytest.raises(StateError, match="record_events"):
        world.drain_events()
