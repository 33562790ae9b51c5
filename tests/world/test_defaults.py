"""`World()` is what a game wants: bodies touch each other, fall asleep, and colliders can come later."""

import re

import pytest

from taichi_soft import (
    Contact,
    Material,
    OptionError,
    SoftBodyAsset,
    SphereShape,
    StateError,
    World,
    box,
)
from taichi_soft.bodies.capacity import LEAST
from taichi_soft.persistence.recorder import read_recording
from taichi_soft.world.bare import bare_world
from taichi_soft.world.world import context_of_world

DT = 1 / 60
EDGE = 0.5
BLOCK = box((EDGE,) * 3, (2, 2, 2))
FIRM = Material(5e5, 0.3, 1000.0, damping_ratio=0.3)


def chosen(world):
    return context_of_world(world).contact


def built(world, *places, **options):
    for place in places:
        world.add_body(BLOCK, FIRM, position=place, **options)
    world.build()
    return world


def step(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


@pytest.fixture(scope="module")
def stack():
    """Two blocks, one dropped onto the other, after six seconds."""
    world = built(World(record=2), (0, 0, 0.26), (0, 0, 0.9))
    step(world, 6.0)
    return world


def test_a_body_that_falls_onto_another_lies_on_it(stack):
    lower, upper = stack.bodies
    assert lower.positions()[:, 2].min() == pytest.approx(0.0, abs=0.01)
    assert upper.positions()[:, 2].min() > 0.9 * EDGE


def test_without_contact_between_bodies_it_passes_through():
    world = built(World(soft_contact=False), (0, 0, 0.26), (0, 0, 0.9))
    step(world, 2.0)
    assert world.bodies[1].positions()[:, 2].min() == pytest.approx(0.0, abs=0.01)


def test_bodies_at_rest_fall_asleep_and_wake_when_pushed(stack):
    lower, upper = stack.bodies
    assert lower.is_asleep
    assert upper.is_asleep
    before = upper.center_of_mass()
    upper.apply_impulse((0, 0, 2.0 * upper.masses.sum()))
    step(stack, 0.1)
    assert not upper.is_asleep
    assert upper.center_of_mass()[2] > before[2] + 0.1
    step(stack, 6.0)
    assert upper.is_asleep


@pytest.mark.parametrize(("make", "sleeps"), [(World, True), (bare_world, False)])
def test_a_body_alone_falls_asleep_but_not_in_a_bare_world(make, sleeps):
    world = built(make(), (0, 0, 0.26))
    step(world, 4.0)
    assert world.bodies[0].is_asleep == sleeps


def test_a_body_alone_is_built_without_contact_between_bodies():
    world = built(World(), (0, 0, 1))
    assert not context_of_world(world).built.program.has_soft_contact
    assert not context_of_world(world).built.state.capacity.contact.soft
    with pytest.raises(StateError, match=r"soft_contact=True"):
        world.bodies[0].set_friction(0.1)


def cases():
    itself = SoftBodyAsset(BLOCK, FIRM, contact=Contact(itself=True))
    alone = SoftBodyAsset(BLOCK, FIRM)
    yield "one", lambda w: w.add_body(alone), False
    yield "a pool of one", lambda w: w.reserve(alone, 1), False
    yield "two", lambda w: [w.add_body(alone), w.add_body(alone, position=(2, 0, 0))], True
    yield "a pool of two", lambda w: w.reserve(alone, 2), True
    yield "one that touches itself", lambda w: w.add_body(itself), True


CASES = {name: (add, expected) for name, add, expected in cases()}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("given", [None, True, False])
def test_contact_between_bodies_is_there_where_anything_can_touch_or_as_asked_for(name, given):
    add, expected = CASES[name]
    world = World(floor=None, soft_contact=given)
    add(world)
    assert chosen(world).soft is (expected if given is None else given)


def test_implicit_euler_takes_the_substeps_of_contact_where_bodies_can_touch():
    world = World(floor=None, integrator="implicit_euler")
    world.add_body(BLOCK, FIRM)
    assert world.stable_substeps(DT) == 1
    world.add_body(BLOCK, FIRM, position=(2, 0, 0))
    assert world.stable_substeps(DT) == 4  # of 1/240 s


def test_a_second_body_inside_the_first_can_be_refused():
    for options in ({"soft_contact": False}, {"schedule": "flat"}):
        world = World(**options)
        for _ in range(2):  # nothing touches
            world.add_body(BLOCK, FIRM, position=(0, 0, 1), overlap="refuse")
    world = World()
    world.add_body(BLOCK, FIRM, position=(0, 0, 1), overlap="refuse")
    with pytest.raises(OptionError, match="body 0"):
        world.add_body(BLOCK, FIRM, position=(0.1, 0, 1), overlap="refuse")
    assert len(world.bodies) == 1


def test_colliders_can_be_added_after_build_until_an_error_names_number_room_and_remedy():
    world = World()
    for i in range(3):
        world.add_collider(SphereShape(0.1), position=(5, 0, i))
    built(world, (0, 0, 0.26))
    room = context_of_world(world).built.state.capacity.contact.colliders
    assert room >= 3 + 1 + 15  # the floor is one
    for i in range(room - 4):
        added = world.add_collider(SphereShape(0.1), position=(6, 0, i))
    with pytest.raises(StateError) as refusal:
        world.add_collider(SphereShape(0.1), position=(7, 0, 0))
    assert f"{room} colliders are in use" in str(refusal.value)
    assert f"room for {room}" in str(refusal.value)
    named = int(re.search(r"World\(collider_room=(\d+)\)", str(refusal.value))[1])
    assert named == room - 4 + 1
    assert len(world.colliders) == room
    added.remove()
    world.add_collider(SphereShape(0.4), position=(0, 0, 0.6))
    step(world, 0.5)
    assert world.colliders[-1].impulse.any()


@pytest.mark.parametrize("before", [0, 1, 40])
def test_colliders_before_build_leave_the_room_after_it(before, monkeypatch):
    monkeypatch.setitem(LEAST, "colliders", 1)  # as in no game: what is counted shows
    world = World(floor=None)
    for i in range(before):
        world.add_collider(SphereShape(0.1), position=(5, 0, i))
    settings, colliders = chosen(world), context_of_world(world).colliders
    assert settings.collider_room == 15
    assert (
        before + 15 <= colliders.capacity(settings.collider_room, 0, soft=False).colliders < 2 * (before + 15)
    )


def test_flat_can_be_built_with_the_defaults():
    world = built(World(schedule="flat"), (0, 0, 0.5), (2, 0, 0.5))
    world.step(DT, 20)
    assert world.settings.schedule == "flat"
    assert not chosen(world).soft


@pytest.mark.parametrize("options", [{"schedule": "flat"}, {"integrator": "explicit_euler"}])
def test_flat_leaves_out_what_it_does_not_support_and_refuses_it_by_name(options):
    world = World(**options)
    for x in (0, 2):
        world.add_body(BLOCK, FIRM, position=(x, 0, 0.5))
    settings = chosen(world)
    assert (settings.soft, settings.sleep_speed, settings.collider_room) == (False, 0.0, 0)
    for asked in ({"soft_contact": True}, {"sleep_speed": 0.02}, {"collider_room": 1}):
        with pytest.raises(OptionError, match="flat"):
            built(World(**options, **asked), (0, 0, 0.5))


def test_a_recording_has_the_options_that_the_defaults_became(stack, tmp_path):
    made_of, _ = read_recording(stack.save_recording(tmp_path / "a.recording"))
    made = made_of["world"]
    assert (made["soft_contact"], made["sleep_speed"], made["collider_room"]) == (True, 0.02, 15)
