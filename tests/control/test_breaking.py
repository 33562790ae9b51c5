"""Joints and attachments that break: at the weight that hangs from them, and under moving loads."""

import numpy as np
import pytest

from taichi_soft import Broke, Material, OptionError, StateError, box
from taichi_soft.world.bare import bare_world

G, DT = 9.81, 1 / 60
CUBE = box((0.4, 0.4, 0.4), (2, 2, 2))
JELLY = Material(3e5, 0.3, 1000.0, 40.0)
TOP, BOTTOM = (np.flatnonzero(side * CUBE.vertices[:, 2] > 0.19) for side in (1, -1))
WEIGHT = 0.4**3 * 1000.0 * G


@pytest.fixture(scope="module")
def built():
    """A cube that is pinned at its top, and one right below it."""
    world = bare_world(floor=None)
    upper = world.add_body(CUBE, JELLY, position=(0, 0, 2.0))
    world.add_body(CUBE, JELLY, position=(0, 0, 1.6))
    world.build()
    upper.pin(TOP)
    world.record_events([Broke])
    return world, world.snapshot()


@pytest.fixture
def pair(built):
    world, begun = built
    world.restore(begun)
    world.drain_events()
    return world, *world.bodies


def settle(world, *bodies):
    """Let bodies come to rest: damped, then free."""
    for damping in (8.0, 0.0):
        for body in bodies:
            body.set_linear_damping(damping)
        for _ in range(90):
            world.step(DT)


def test_a_joint_holds_just_above_the_weight_and_breaks_just_below(pair):
    world, upper, lower = pair
    joint = lower.attach_to(upper, TOP, onto=BOTTOM)
    settle(world, upper, lower)
    assert joint.force[2] == pytest.approx(WEIGHT, rel=1e-3)
    joint.set_break_force(1.003 * WEIGHT)
    for _ in range(60):
        world.step(DT)
    assert joint.is_attached
    joint.set_break_force(0.997 * WEIGHT)
    world.step(DT)
    assert not joint.is_attached
    (event,) = world.drain_events()
    assert (event.body, event.other, event.handle, event.step) == (lower, upper, joint, world.step_count - 1)
    np.testing.assert_allclose(event.impulse, (0, 0, WEIGHT * DT), rtol=2e-3, atol=1e-3 * WEIGHT * DT)
    start = lower.center_of_mass()[2]
    for _ in range(30):
        world.step(DT)
    assert start - lower.center_of_mass()[2] == pytest.approx(0.5 * G * 0.5**2, rel=0.03)  # it falls freely


def test_a_load_that_is_hung_on_suddenly_breaks_a_joint_that_holds_it_at_rest(built, pair):
    """A load that is applied suddenly to an elastic support pulls with nearly twice its weight."""
    world, upper, lower = pair
    joint = lower.attach_to(upper, TOP, onto=BOTTOM)
    most = 0.0
    for _ in range(40):
        world.step(DT)
        most = max(most, joint.force[2])
    assert 1.2 * WEIGHT < most < 2.5 * WEIGHT
    joint.release()
    for factor, holds in ((1.05 * most / WEIGHT, True), (1.1, False)):
        world.restore(built[1])
        joint = lower.attach_to(upper, TOP, onto=BOTTOM, break_force=factor * WEIGHT)
        for _ in range(40):
            world.step(DT)
        assert joint.is_attached == holds


def test_a_snapshot_carries_the_force_at_which_a_joint_breaks(pair):
    world, upper, lower = pair
    joint = lower.attach_to(upper, TOP, onto=BOTTOM, break_force=1.1 * WEIGHT)
    kept = world.snapshot()
    for _ in range(40):
        world.step(DT)
    assert not joint.is_attached
    broken = world.bodies_hash()
    (first,) = world.drain_events()
    world.restore(kept)
    assert joint.is_attached
    assert joint.break_force == pytest.approx(1.1 * WEIGHT)
    for _ in range(40):
        world.step(DT)
    assert not joint.is_attached
    assert world.bodies_hash() == broken
    (second,) = world.drain_events()
    assert (second.step, second.impulse.tolist()) == (first.step, first.impulse.tolist())


def test_a_joint_breaks_in_every_direction_of_its_force(pair):
    """Without gravity, a body is pushed sideways: the joint carries the push when the body is at rest."""
    world, upper, lower = pair
    world.set_gravity((0, 0, 0))
    joint = lower.attach_to(upper, TOP, onto=BOTTOM)
    lower.set_linear_damping(8.0)
    for force, holds in ((60.0, True), (80.0, False)):
        for step in range(150):
            lower.apply_force((force, 0.0, 0.0))
            world.step(DT)
            if step == 120 and holds:
                joint.set_break_force(70.0)
        assert joint.is_attached == holds


def test_an_attachment_holds_just_above_the_weight_and_breaks_just_below(pair):
    world, upper, lower = pair
    frame = world.add_frame((0, 0, 1.8))
    hold = lower.attach(TOP, frame, two_way=True, break_force=1.2 * WEIGHT)
    beside = upper.attach(BOTTOM, frame, two_way=True)
    assert hold.break_force == pytest.approx(1.2 * WEIGHT)
    hold.set_break_force(None)
    settle(world, upper, lower)
    assert hold.force[2] == pytest.approx(-WEIGHT, rel=1e-3)
    hold.set_break_force(1.003 * WEIGHT)
    kept = world.snapshot()
    for limit, holds in ((None, True), (0.997 * WEIGHT, False)):
        world.restore(kept)
        assert hold.break_force == pytest.approx(1.003 * WEIGHT)
        if limit is not None:
            hold.set_break_force(limit)
        for _ in range(30 if holds else 1):
            world.step(DT)
        assert hold.is_attached == holds
    assert beside.is_attached
    assert len(lower.pinned) == 0
    (event,) = world.drain_events()
    assert (event.body, event.other, event.handle) == (lower, frame, hold)
    np.testing.assert_allclose(event.impulse, (0, 0, WEIGHT * DT), rtol=2e-3, atol=1e-3 * WEIGHT * DT)


def test_bad_forces_are_refused_and_change_nothing(pair):
    world, upper, lower = pair
    for bad in (0.0, -1.0, float("nan"), "strong", 1e30, 1e-60):
        with pytest.raises(OptionError, match="break_force"):
            lower.attach_to(upper, TOP, onto=BOTTOM, break_force=bad)
    assert len(world.joints) == 0
    joint = lower.attach_to(upper, TOP, onto=BOTTOM, break_force=5.0)
    with pytest.raises(OptionError, match="break_force"):
        joint.set_break_force(0.0)
    assert joint.break_force == 5.0
    joint.set_break_force(None)
    assert joint.break_force is None
    frame = world.add_frame((0, 0, 1.8))
    with pytest.raises(OptionError, match="two_way"):
        lower.attach([0], frame, break_force=5.0)
    with pytest.raises(StateError, match="two_way"):
        lower.attach([0], frame).set_break_force(5.0)
    with pytest.raises(OptionError, match="break_force"):
        upper.attach([0], frame, two_way=True, break_force=-1.0)
