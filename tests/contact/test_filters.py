"""Groups and masks that change while a world runs: who touches whom, who wakes, which contacts end."""

import numpy as np
import pytest

from taichi_soft import (
    Contact,
    ContactBegan,
    ContactEnded,
    Material,
    OptionError,
    PlaneShape,
    SoftBodyAsset,
    box,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
G = 9.81
JELLY = Material(young=2e5, poisson=0.3, density=1000.0, damping_ratio=0.3)
CUBE = SoftBodyAsset(box((0.4, 0.4, 0.4), (2, 2, 2)), JELLY)


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def height(body):
    return float(body.center_of_mass()[2])


@pytest.fixture(scope="module")
def stacked():
    """A cube on a cube on a plane at 0 m, both asleep; another plane 3 m below touches all."""
    world = bare_world(floor=-3.0, soft_contact=True, sleep_speed=0.05, collider_room=4)
    ground = world.add_collider(PlaneShape())
    world.reserve(CUBE, 3)
    for level in range(2):
        world.spawn(CUBE, position=(0.0, 0.0, 0.21 + 0.41 * level))
    world.build()
    world.record_events([ContactBegan, ContactEnded])
    run(world, 3.0)
    assert all(body.is_asleep for body in world.bodies)
    return world, ground, world.snapshot()


@pytest.fixture
def stack(stacked):
    world, ground, kept = stacked
    world.restore(kept)
    return world, ground, *world.bodies


def fell_freely(before, body, seconds):
    return before - height(body) == pytest.approx(0.5 * G * seconds**2, rel=0.02)


def test_a_collider_that_no_longer_touches_lets_sleeping_bodies_fall_at_once(stack):
    world, ground, lower, upper = stack
    before = height(lower) + height(upper)
    ground.set_filter(2, 2)
    assert (ground.group, ground.mask) == (2, 2)
    run(world, 0.5)
    # The two are pressed together, so only their common centre falls freely.
    fall = 0.5 * (before - height(lower) - height(upper))
    assert fall == pytest.approx(0.5 * G * 0.5**2, rel=0.02)
    ground.set_filter(1, 1)
    ended = [each for each in world.drain_events() if isinstance(each, ContactEnded) and each.b is ground]
    assert [each.a for each in ended] == [lower]


def test_a_body_that_no_longer_touches_falls_and_its_contacts_end_in_the_next_step(stack):
    world, ground, lower, upper = stack
    world.drain_events()
    step, start = world.step_count, height(upper)
    lower.set_filter(1, 0)
    assert (lower.group, lower.mask) == (1, 0)
    assert not lower.is_asleep
    assert not upper.is_asleep  # it lay on the other
    world.step(DT)
    ended = [each for each in world.drain_events() if isinstance(each, ContactEnded)]
    assert [(each.step, each.a, each.b) for each in ended] == [(step, lower, ground), (step, lower, upper)]
    run(world, 0.1 - DT)
    assert fell_freely(start, upper, 0.1)  # until it reaches the ground, which still holds it
    run(world, 1.5)
    assert height(upper) == pytest.approx(0.2, abs=0.02)
    assert height(lower) < -3.0


def test_two_bodies_that_begin_to_touch_while_they_overlap_are_moved_apart(stack):
    world, _, lower, upper = stack
    upper.set_filter(2, 1)
    lower.set_filter(1, 1)  # the group of `upper` is not in the mask of `lower`
    run(world, 1.5)
    assert height(upper) < 0.3  # the cubes are at the same place
    energy = [body.elastic_energy() for body in (lower, upper)]
    upper.set_filter(1, 1)
    run(world, 2.0)
    difference = np.abs(lower.center_of_mass() - upper.center_of_mass())
    assert difference.max() > 0.38
    for body, before in zip((lower, upper), energy, strict=True):
        assert body.elastic_energy() < before + 5.0
        assert not body.is_frozen


def test_a_filter_is_part_of_a_snapshot_and_a_new_body_has_that_of_its_asset(stack):
    world, ground, lower, upper = stack
    upper.set_filter(4, 5)
    ground.set_filter(3, 7)
    kept = world.snapshot()
    upper.set_filter(1, 1)
    ground.set_filter(1, 1)
    world.restore(kept)
    assert (upper.group, upper.mask, ground.group, ground.mask) == (4, 5, 3, 7)
    index = upper.index
    world.despawn(upper)
    new = world.spawn(CUBE, position=(0.0, 0.0, 0.9))
    assert new.index == index
    assert (new.group, new.mask) == CUBE.contact.filter
    assert lower.group == Contact().group


def test_a_filter_that_changes_nothing_wakes_nobody(stack):
    world, ground, lower, upper = stack
    lower.set_filter(lower.group, lower.mask)
    ground.set_filter(ground.group, ground.mask)
    assert lower.is_asleep
    assert upper.is_asleep
    upper.set_filter(3, upper.mask)  # only near bodies wake
    assert not lower.is_asleep
    run(world, 0.5)
    assert height(upper) == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize("bad", [(-1, 1), (1, 2**31), (1.5, 1), ("all", 1), (1, None)])
def test_what_is_no_bit_field_is_refused_and_changes_nothing(stack, bad):
    world, ground, lower, _ = stack
    before = world.state_hash()
    for each in (ground, lower):
        with pytest.raises(OptionError, match=r"group|mask"):
            each.set_filter(*bad)
    assert world.state_hash() == before


def test_a_teleport_asks_only_colliders_that_the_body_touches_now(stack):
    *_, upper = stack
    with pytest.raises(OptionError, match="inside collider"):
        upper.teleport((3.0, 0.0, -0.1))
    upper.set_filter(2, 0)
    upper.teleport((3.0, 0.0, -0.1))
    assert height(upper) == pytest.approx(-0.1, abs=1e-3)
