"""Bodies at rest fall asleep, island by island, and wake for what concerns them."""

import numpy as np
import pytest

from taichi_soft import BoxShape, Contact, Material, World, box

DT = 1 / 60
EDGE = 0.5
BLOCK = box((EDGE,) * 3, (2, 2, 2))
FIRM = Material(5e5, 0.3, 1000.0, 200.0)
FAR = 40.0


def step(world, seconds):
    for _ in range(round(seconds * 60)):
        world.step(DT)


def state_of(world):
    return [np.concatenate([body.positions(), body.velocities()]) for body in world.bodies]


@pytest.fixture
def piles():
    """Two blocks on each other, one alone, and one on a shelf of its own far away; all asleep after a while.

    Returns: the world, the shelf.
    """
    world = World(soft_contact=True, sleep_speed=0.05, collider_room=4)
    shelf = world.add_collider(BoxShape((2, 2, 0.4)), position=(2 * FAR, 0, 0.2))
    for place in ((0, 0, 0.25), (0, 0, 0.77), (FAR, 0, 0.3), (2 * FAR, 0, 0.7)):
        world.add_body(BLOCK, FIRM, position=place)
    world.build()
    step(world, 6.0)
    assert all(body.is_asleep for body in world.bodies)
    return world, shelf


def who_sleeps(world):
    return [body.is_asleep for body in world.bodies]


def test_who_sleeps_is_left_alone_bit_for_bit(piles):
    world, _ = piles
    before = state_of(world)
    step(world, 3.0)
    assert all(who_sleeps(world))
    for one, other in zip(before, state_of(world), strict=True):
        np.testing.assert_array_equal(one, other)
        assert not other[len(other) // 2 :].any()


def test_nobody_sleeps_who_moves_or_where_sleep_is_off():
    world = World(soft_contact=True, sleep_speed=0.05, collider_room=4)
    slider = world.add_body(BLOCK, FIRM, position=(0, 0, 0.25), velocity=(3.0, 0, 0))
    thrown = world.add_body(BLOCK, FIRM, position=(FAR, 0, 1.0), velocity=(0, 0, 9.0))
    world.build()
    step(world, 0.55)
    assert not slider.is_asleep
    step(world, 0.4)  # about the top of its flight
    assert np.abs(thrown.momentum()[2] / thrown.masses.sum()) < 1.0
    assert not thrown.is_asleep
    step(world, 6.0)
    assert slider.is_asleep
    assert thrown.is_asleep
    del world, slider, thrown
    world = World(soft_contact=True, collider_room=4)
    world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    step(world, 4.0)
    assert not world.bodies[0].is_asleep


def test_an_impulse_wakes_whom_it_hits_and_those_it_lies_on(piles):
    world, _ = piles
    world.bodies[1].apply_impulse((0, 0, 50.0))
    assert who_sleeps(world) == [True, False, True, True]
    world.step(DT)
    assert who_sleeps(world) == [False, False, True, True]
    step(world, 6.0)
    assert all(who_sleeps(world))


def test_what_comes_flying_wakes_whom_it_may_hit(piles):
    world, _ = piles
    world.bodies[2].teleport((3.0, 0, 1.5))
    world.bodies[2].set_velocity((-6.0, 0, 0))
    world.step(DT)
    assert who_sleeps(world) == [True, True, False, True]
    before = state_of(world)
    step(world, 0.7)
    assert who_sleeps(world) == [False, False, False, True]
    assert np.abs(world.bodies[1].center_of_mass() - before[1][:27].mean(axis=0)).max() > 0.05
    np.testing.assert_array_equal(state_of(world)[3], before[3])


def test_a_moving_collider_wakes_whom_it_comes_near(piles):
    world, _ = piles
    club = world.add_collider(BoxShape((0.4, 2, 2)), position=(FAR - 3.0, 0, 1.0))
    step(world, 3.0)  # an arriving collider wakes everybody; now they sleep again
    assert all(who_sleeps(world))
    before = state_of(world)
    club.set_velocity((2.0, 0, 0))
    step(world, 0.5)
    assert all(who_sleeps(world))  # it is still far away
    step(world, 1.2)
    assert who_sleeps(world) == [True, True, False, True]
    assert world.bodies[2].center_of_mass()[0] > FAR + 0.3
    np.testing.assert_array_equal(state_of(world)[0], before[0])


@pytest.mark.parametrize("way", ["removed", "teleported", "moved"])
def test_whose_support_goes_falls(piles, way):
    world, shelf = piles
    if way == "removed":
        shelf.remove()
    elif way == "teleported":
        shelf.teleport((2 * FAR, 5.0, 0.2))
    else:
        shelf.move_to((2 * FAR, 5.0, 0.2))
    step(world, 1.0)
    assert world.bodies[3].center_of_mass()[2] < 0.35


def test_who_lay_on_a_body_that_went_falls(piles):
    world, _ = piles
    upper = world.bodies[1]
    world.despawn(world.bodies[0])
    step(world, 1.0)
    assert upper.center_of_mass()[2] < 0.3


def test_an_island_falls_asleep_together():
    """A block that rests long before its neighbour on top does stays awake as long as that moves."""
    world = World(soft_contact=True, sleep_speed=0.05, collider_room=4)
    world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.add_body(BLOCK, FIRM, position=(0.05, 0, 0.8))
    world.add_body(BLOCK, FIRM, position=(FAR, 0, 0.26), contact=Contact(group=2, mask=2))
    world.build()
    step(world, 1.0)
    for _ in range(400):
        world.bodies[1].apply_impulse((0, 0, 0.3 * world.bodies[1].masses.sum()))
        step(world, 0.2)
        assert not world.bodies[0].is_asleep
        if world.step_count > 300:
            break
    step(world, 1 / 6)
    seen = set()
    for _ in range(300):
        world.step(DT)
        seen.add((world.bodies[0].is_asleep, world.bodies[1].is_asleep))
    assert seen == {(False, False), (True, True)}
