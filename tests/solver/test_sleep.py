"""Bodies at rest fall asleep, island by island, and wake for what concerns them."""

import numpy as np
import pytest

from taichi_soft import BoxShape, Contact, Material, PlaneShape, SphereShape, box
from taichi_soft.world.bare import bare_world

DT = 1 / 60
EDGE = 0.5
BLOCK = box((EDGE,) * 3, (2, 2, 2))
FIRM = Material(5e5, 0.3, 1000.0, 200.0)
FAR = 40.0
NOWHERE = np.array((0.0, 200.0, 0.7))
BESIDE_ONE = np.array((FAR, 0.0, 0.7))


def step(world, seconds):
    for _ in range(round(seconds * 60)):
        world.step(DT)


def state_of(world):
    return [np.concatenate([body.positions(), body.velocities()]) for body in world.bodies]


@pytest.fixture(scope="module")
def asleep():
    """Two blocks on each other, one alone, and one on a shelf of its own far away; all asleep after a while.

    Returns: the world, the shelf, and a snapshot.
    """
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=4)
    shelf = world.add_collider(BoxShape((2, 2, 0.4)), position=(2 * FAR, 0, 0.2))
    for place in ((0, 0, 0.25), (0, 0, 0.77), (FAR, 0, 0.3), (2 * FAR, 0, 0.7)):
        world.add_body(BLOCK, FIRM, position=place)
    world.build()
    step(world, 6.0)
    assert all(body.is_asleep for body in world.bodies)
    return world, shelf, world.snapshot()


@pytest.fixture
def piles(asleep):
    """The world of `asleep` as it was then, and the shelf."""
    world, shelf, data = asleep
    world.restore(data)
    yield world, shelf
    world.set_force_field(None)


def test_who_sleeps_is_drawn_where_it_lies_at_any_time(piles):
    world, _ = piles
    step(world, 0.1)
    for body in world.bodies:
        assert body.is_asleep
        skin = body.render_mesh()
        expected = body.positions()[skin.body_vertices]
        for alpha in (0.0, 0.4, 1.0):
            positions, normals = world.read_render_mesh(skin, alpha)
            np.testing.assert_allclose(positions, expected, atol=1e-5)
            np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)


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
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=4)
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
    world = bare_world(soft_contact=True, collider_room=4)
    world.add_body(BLOCK, FIRM, position=(0, 0, 0.25))
    world.build()
    step(world, 4.0)
    assert not world.bodies[0].is_asleep


def test_where_all_sleep_no_kernel_runs_until_something_changes(piles, monkeypatch):
    world, shelf = piles
    made, launch = [], world._built.launch

    def counted(substeps, h):
        made.append(substeps)
        return launch(substeps, h)

    world.step(DT)  # the first after `restore` looks who sleeps
    monkeypatch.setattr(world._built, "launch", counted)
    step(world, 0.5)
    assert not made
    shelf.set_velocity((0, 0, 0.01))
    world.step(DT)
    assert len(made) == 1
    assert who_sleeps(world) == [True, True, True, False]
    world.bodies[0].set_velocity((0, 0, 1.0))
    world.step(DT)
    assert len(made) == 2
    assert not all(who_sleeps(world)[:2])


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
    world.step(DT)
    assert who_sleeps(world) == [True, True, True, False]
    step(world, 1.0)
    assert world.bodies[3].center_of_mass()[2] < 0.35


def test_who_lay_on_what_jumped_with_its_frame_falls(piles):
    world, _ = piles
    lower, upper = world.bodies[:2]
    frame = world.add_frame()
    lower.attach(np.flatnonzero(BLOCK.vertices[:, 2] < -0.24), frame)
    step(world, 2.0)
    height = upper.center_of_mass()[2]
    assert height > 0.7
    frame.teleport((0, 9.0, 0))
    world.step(DT)
    assert who_sleeps(world)[1:] == [False, True, True]
    step(world, 1.0)
    assert upper.center_of_mass()[2] < 0.35
    assert lower.center_of_mass()[1] == pytest.approx(9.0, abs=0.01)


@pytest.mark.parametrize("way", ["despawned", "teleported", "set"])
def test_who_lay_on_a_body_that_went_falls_and_others_sleep_on(piles, way):
    world, _ = piles
    lower, upper, *others = world.bodies
    if way == "despawned":
        world.despawn(lower)
    elif way == "teleported":
        lower.teleport(NOWHERE)
    else:
        lower.set_motion(lower.positions() + NOWHERE, lower.velocities())
    world.step(DT)
    assert not upper.is_asleep
    assert all(body.is_asleep for body in others)
    step(world, 1.0)
    assert upper.center_of_mass()[2] < 0.3


def test_nobody_wakes_for_a_body_that_goes_far_away(piles):
    world, _ = piles
    *others, last = world.bodies
    last.teleport(NOWHERE)
    world.despawn(last)
    world.step(DT)
    assert all(body.is_asleep for body in others)


APPEARING = {
    "explosion": lambda world, place: world.apply_radial_impulse(place, 1.0, 0.4),
    "collider": lambda world, place: world.add_collider(SphereShape(0.3), position=place),
    "jump": lambda world, place: world.add_collider(SphereShape(0.3), position=2 * NOWHERE).teleport(place),
}


@pytest.mark.parametrize("appear", APPEARING.values(), ids=APPEARING)
def test_what_appears_wakes_whom_it_is_near_and_nobody_else(piles, appear):
    world, _ = piles
    before = state_of(world)
    appear(world, NOWHERE)
    world.step(DT)
    assert all(who_sleeps(world))
    appear(world, BESIDE_ONE)
    world.step(DT)
    assert who_sleeps(world) == [True, True, False, True]
    for i in (0, 1, 3):
        np.testing.assert_array_equal(state_of(world)[i], before[i])


def test_a_collider_without_end_wakes_all(piles):
    world, _ = piles
    world.add_collider(PlaneShape(), position=(0, 0, -100.0)).remove()
    assert not any(who_sleeps(world))


def test_only_another_wind_wakes(piles):
    world, _ = piles
    world.set_wind(None)
    assert all(who_sleeps(world))
    world.set_wind((1.0, 0, 0))
    assert not any(who_sleeps(world))
    step(world, 3.0)
    world.set_wind((1.0, 0, 0))
    assert all(who_sleeps(world))
    world.set_wind(None)
    assert not any(who_sleeps(world))


def test_a_force_field_wakes_whom_it_pushes(piles):
    world, _ = piles
    before = state_of(world)
    world.set_force_field(lambda x, t: np.zeros_like(x))
    world.step(DT)
    assert all(who_sleeps(world))
    world.set_force_field(lambda x, t: np.outer(np.abs(x[:, 0] - FAR) < 2.0, (0.0, 0.0, 20.0)))
    step(world, 0.2)
    assert who_sleeps(world) == [True, True, False, True]
    assert world.bodies[2].center_of_mass()[2] > 0.3
    np.testing.assert_array_equal(state_of(world)[3], before[3])


def test_who_is_put_into_the_air_just_before_it_would_sleep_falls(piles):
    world, _ = piles
    start, short, calm = world.snapshot(), 1 / 1000, 0  # in which it does not become fast
    world.wake()
    while not world.bodies[2].is_asleep and calm < 10_000:
        world.step(short, 20)
        calm += 1
    world.restore(start)
    world.wake()
    for _ in range(calm - 1):
        world.step(short, 20)
    world.bodies[2].set_motion(np.array((FAR, 0, 2.0)) + BLOCK.vertices, np.zeros_like(BLOCK.vertices))
    world.step(short, 20)
    assert not world.bodies[2].is_asleep
    step(world, 0.2)
    assert world.bodies[2].center_of_mass()[2] < 1.9


def test_an_island_falls_asleep_together():
    """A block that rests long before the block on top of it stays awake as long as the upper block moves."""
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=4)
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
