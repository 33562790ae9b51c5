"""Bodies that are switched off and on: what they keep, and who notices."""

import numpy as np
import pytest

from taichi_soft import (
    BoxShape,
    ContactBegan,
    ContactEnded,
    Entered,
    Event,
    FellAsleep,
    FrozenBodyWarning,
    Left,
    Material,
    OptionError,
    SoftBodyAsset,
    SphereShape,
    StateError,
    Woke,
    box,
    sphere,
)
from taichi_soft.world.bare import bare_world

DT = 1 / 60
G = 9.81
JELLY = Material(young=2e5, poisson=0.3, density=1000.0, damping_ratio=0.3)
CUBE = SoftBodyAsset(box((0.4, 0.4, 0.4), (2, 2, 2)), JELLY)
BALL = SoftBodyAsset(sphere(radius=0.2, resolution=3), JELLY)


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def height(body):
    return float(body.center_of_mass()[2])


def trembling_ball(world):
    """Start a ball that is deformed, flies and turns."""
    ball = world.spawn(BALL, velocity=(1.0, 0.5, 3.0), angular_velocity=(3.0, 1.0, 0.0))
    x = ball.positions().astype(np.float64)
    ball.set_motion(x * [1.1, 0.95, 1.0], ball.velocities())
    return ball


@pytest.mark.parametrize("integrator", ["leapfrog", "implicit_euler"])
def test_a_body_goes_on_from_where_it_was_switched_off_to_the_same_bits(integrator):
    """The oracle is the same flight without the pause."""
    flights = []
    for pause in (0, 40):
        world = bare_world(floor=None, integrator=integrator)
        world.reserve(BALL, 1)
        world.build()
        ball = trembling_ball(world)
        run(world, 0.25)
        if pause:
            before = ball.positions(), ball.velocities()
            ball.set_enabled(False)
            assert not ball.is_enabled
            for _ in range(pause):
                world.step(DT)
                for alpha in (0.0, 0.5, 1.0):
                    np.testing.assert_array_equal(world.read_positions(ball, alpha), before[0])
            np.testing.assert_array_equal(ball.velocities(), before[1])
            ball.set_enabled(True)
        run(world, 0.25)
        flights.append((ball.positions(), ball.velocities()))
    for one, other in zip(*flights, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.fixture(scope="module")
def settled():
    """A cube on a cube on the floor, and a third far away: all asleep."""
    world = bare_world(floor=0.0, soft_contact=True, sleep_speed=0.05, collider_room=4)
    world.reserve(CUBE, 4)
    for place in ((0.0, 0.0, 0.205), (0.0, 0.0, 0.615), (9.0, 0.0, 0.205)):
        world.spawn(CUBE, position=place)
    world.add_sensor(BoxShape((1.0, 1.0, 0.6)), position=(0.0, 0.0, 0.3))
    world.build()
    world.record_events([Event])
    run(world, 3.0)
    assert all(body.is_asleep for body in world.bodies)
    return world, world.snapshot()


@pytest.fixture
def stack(settled):
    world, kept = settled
    world.restore(kept)
    world.drain_events()
    return world, *world.bodies


def test_what_lay_on_a_body_that_is_switched_off_falls_through_it(stack):
    world, lower, upper, far = stack
    start = height(upper)
    lower.set_enabled(False)
    assert not upper.is_asleep
    run(world, 0.15)
    assert start - height(upper) == pytest.approx(0.5 * G * 0.15**2, rel=0.02)
    run(world, 2.0)
    assert height(upper) == pytest.approx(0.2, abs=0.02)
    assert far.is_asleep
    assert not lower.is_asleep
    assert not lower.is_frozen


def test_its_contacts_and_stays_in_sensors_end_at_once_and_begin_again(stack):
    world, lower, upper, _ = stack
    floor, gate = world.floor_collider, world.colliders[0]
    lower.set_enabled(False)
    upper.set_enabled(False)
    assert gate.bodies_inside == ()
    step = world.step_count
    world.step(DT)
    events = world.drain_events()
    assert {each.step for each in events} == {step}
    ended = [(each.a, each.b) for each in events if isinstance(each, ContactEnded)]
    assert ended == [(lower, floor), (lower, upper)]
    assert [each.body for each in events if isinstance(each, Left)] == [lower, upper]
    assert not [each for each in events if isinstance(each, (Woke, FellAsleep))]
    lower.set_enabled(True)
    upper.set_enabled(True)
    run(world, 0.5)
    events = world.drain_events()
    began = [(each.a, each.b) for each in events if isinstance(each, ContactBegan)]
    assert began == [(lower, floor), (lower, upper)]
    assert [each.body for each in events if isinstance(each, Entered)] == [lower, upper]


def test_a_collider_receives_nothing_from_a_body_that_is_off(stack):
    world, lower, upper, far = stack
    world.wake()
    world.step(DT)
    floor = world.floor_collider
    weight = G * lower.masses.sum() * DT
    assert -floor.impulse[2] > 2 * weight  # of three
    lower.set_enabled(False)
    upper.set_enabled(False)
    for _ in range(3):
        world.step(DT)
        assert 0.5 * weight < -floor.impulse[2] < 1.5 * weight  # of the third
    far.set_enabled(False)
    world.step(DT)
    np.testing.assert_array_equal(floor.impulse, np.zeros(3))


def test_queries_and_explosions_skip_it(stack):
    world, lower, upper, _ = stack
    lower.set_enabled(False)
    middle, before = lower.center_of_mass(), lower.velocities()
    hit = world.raycast((3.0, 0.0, 0.2), (-1.0, 0.0, 0.0))
    assert hit is None or hit.body is not lower
    assert lower not in [each.body for each in world.overlap_sphere(middle, 0.1)]
    assert world.closest_point(middle).body is upper
    world.apply_radial_impulse(middle + 0.01, 20.0, 3.0)
    np.testing.assert_array_equal(lower.velocities(), before)
    assert lower in world.bodies
    assert (lower,) in world.islands


def test_a_body_that_is_switched_on_in_another_is_moved_apart_from_it(stack):
    world, lower, upper, _ = stack
    lower.set_enabled(False)
    run(world, 2.0)
    assert abs(height(upper) - height(lower)) < 0.02
    lower.set_enabled(True)
    run(world, 2.0)
    assert np.abs(lower.center_of_mass() - upper.center_of_mass()).max() > 0.38
    for body in (lower, upper):
        assert np.abs(body.velocities()).max() < 0.5
        assert not body.is_frozen


def test_a_snapshot_and_a_new_body_in_the_slot(stack):
    world, lower, *_ = stack
    lower.set_enabled(False)
    kept, code = world.snapshot(), world.bodies_hash()
    lower.set_enabled(True)
    assert world.bodies_hash() != code
    world.restore(kept)
    assert not lower.is_enabled
    assert world.bodies_hash() == code
    index = lower.index
    world.despawn(lower)
    new = world.spawn(CUBE, position=(0.0, 0.0, 3.0))
    assert new.index == index
    assert new.is_enabled


def test_calls_still_move_it_and_leave_it_off(stack):
    world, lower, *_ = stack
    lower.set_enabled(False)
    lower.teleport((4.0, 0.0, 1.0))
    lower.set_velocity((1.0, 0.0, 0.0))
    world.wake()
    run(world, 0.1)
    np.testing.assert_allclose(lower.center_of_mass(), (4.0, 0.0, 1.0), atol=1e-5)
    lower.set_motion(lower.positions(), lower.velocities())
    assert not lower.is_enabled
    lower.set_enabled(True)
    run(world, 0.1)
    assert lower.center_of_mass()[0] == pytest.approx(4.1, abs=0.01)


def test_a_frozen_body_is_frozen_again(stack):
    world, lower, *_ = stack
    rows = np.ones((lower.vertex_count, 3))
    lower.set_motion(9.9999e6 * rows, 1.9e4 * rows)
    with pytest.warns(FrozenBodyWarning):
        world.step(DT)
    assert lower.is_frozen
    before = lower.positions()
    lower.set_enabled(False)
    world.step(DT)
    lower.set_enabled(True)
    run(world, 0.1)
    assert lower.is_frozen
    np.testing.assert_array_equal(lower.positions(), before)


@pytest.mark.parametrize("soft_contact", [False, True])
def test_a_joint_pauses_while_one_of_its_bodies_is_off(soft_contact):
    world = bare_world(floor=None, soft_contact=soft_contact, sleep_speed=0.02, gravity=(0, 0, -G))
    top = world.add_body(CUBE.mesh, JELLY, pinned=range(9))
    low = world.add_body(CUBE, position=(0.0, 0.0, -0.4))
    world.build()
    ends = np.flatnonzero(low.mesh.vertices[:, 2] > 0.19)
    joint = low.attach_to(top, ends)
    run(world, 1.0)
    hangs = height(low)
    assert hangs > -0.6
    top.set_enabled(False)
    run(world, 0.25)
    assert hangs - height(low) == pytest.approx(0.5 * G * 0.25**2, rel=0.1)
    low.set_enabled(False)
    low.teleport((0.0, 0.0, hangs), keep_velocity=False)
    top.set_enabled(True)
    low.set_enabled(True)
    assert joint.is_attached
    run(world, 1.0)
    assert height(low) == pytest.approx(hangs, abs=0.05)


@pytest.mark.parametrize("bad", [None, 1, "off"])
def test_what_is_no_flag_is_refused(stack, bad):
    world, lower, *_ = stack
    before = world.state_hash()
    with pytest.raises(OptionError, match="is_enabled"):
        lower.set_enabled(bad)
    assert world.state_hash() == before


def test_schedule_flat_and_a_world_that_is_not_built_refuse_it():
    world = bare_world(floor=0.0, schedule="flat")
    cube = world.add_body(CUBE, position=(0.0, 0.0, 1.0))
    with pytest.raises(StateError, match="build"):
        cube.set_enabled(False)
    world.build()
    with pytest.raises(StateError, match="flat"):
        cube.set_enabled(False)
    assert cube.is_enabled


def test_a_body_that_is_off_cannot_be_cut():
    world = bare_world(floor=0.0)
    cube = world.add_body(CUBE.mesh, JELLY, position=(0.0, 0.0, 1.0), spare_vertices=40)
    world.build()
    cube.set_enabled(False)
    with pytest.raises(StateError, match="switched off"):
        cube.cut(plane=((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)))


def test_a_world_whose_bodies_are_off_launches_no_step(stack):
    world, *bodies = stack
    for body in bodies:
        body.set_enabled(False)
    world.step(DT)
    world.step(DT)
    assert world._built._is_still
    world.add_sensor(SphereShape(1.0)).move_to((1.0, 0.0, 0.0))
    world.step(DT)
    assert world._built._is_still
