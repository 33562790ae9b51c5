"""Joints of bodies that sleep, freeze, go and come back, by snapshot and by recording.

In a file of their own: their world is gone before those of `test_joints`, which take over its kernels.
"""

import numpy as np
import pytest

from taichi_soft import FrozenBodyWarning, Material, SoftBodyAsset, StateError, box
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

G, DT = 9.81, 1 / 60
BIG = box(cells=(2, 2, 2))
TOP = np.flatnonzero(BIG.vertices[:, 2] > 0.49)
BOTTOM = np.flatnonzero(BIG.vertices[:, 2] < -0.49)


@pytest.fixture(scope="module")
def resting(tmp_path_factory):
    """A world with sleep and room for three blocks."""
    out = tmp_path_factory.mktemp("frozen") / "frozen.recording"
    world = bare_world(soft_contact=True, sleep_speed=0.05, record=500, record_to=out, retries=0)
    kind = SoftBodyAsset(BIG, Material(1e5, 0.3, 1000.0, 200.0))
    world.reserve(kind, 3)
    world.build()
    return world, kind


@pytest.fixture
def empty(resting):
    world, kind = resting
    for body in world.bodies:
        world.despawn(body)
    return world, kind


def test_joined_bodies_sleep_and_wake_together(empty):
    """One on the floor, one that hangs in the air beside it on a joint and swings a while."""
    world, kind = empty
    a = world.spawn(kind, position=(0, 0, 0.51))
    b = world.spawn(kind, position=(0, 0, 1.51))
    b.attach_to(a, BOTTOM)
    for _ in range(600):
        world.step(DT)
        assert a.is_asleep == b.is_asleep
        if a.is_asleep:
            break
    assert a.is_asleep
    where = b.positions()
    for _ in range(10):
        world.step(DT)
    assert b.positions().tobytes() == where.tobytes()
    a.apply_impulse((0.0, 0.0, 2000.0))
    world.step(DT)
    assert not a.is_asleep
    assert not b.is_asleep


def test_despawn_of_either_ends_the_joint(empty):
    world, kind = empty
    for leaves in (0, 1):
        a = world.spawn(kind, position=(0, 0, 3.0))
        b = world.spawn(kind, position=(0, 0, 2.0))
        joint = b.attach_to(a, TOP)
        assert joint.is_attached
        assert a.is_held
        assert b.is_held
        world.step(DT)
        world.despawn((a, b)[leaves])
        left = (b, a)[leaves]
        assert not joint.is_attached
        assert not left.is_held
        assert repr(joint).endswith("released)")
        for use in (joint.release, lambda j=joint: j.force):
            with pytest.raises(StateError):
                use()
        speed = left.velocities()[:, 2].mean()
        world.step(DT)
        assert left.velocities()[:, 2].mean() == pytest.approx(speed - G * DT, rel=1e-3)
        world.despawn(left)


def test_a_frozen_body_holds_the_other_where_it_is(empty):
    """And the frame that it is on bears the other's weight alone."""
    world, kind = empty
    a = world.spawn(kind, position=(0, 0, 3.0))
    b = world.spawn(kind, position=(0, 0, 2.0))
    joint, hold = b.attach_to(a, TOP), a.attach(BOTTOM, world.add_frame(), two_way=True)
    world.step(DT)
    where = a.positions()
    a.set_motion(where, 1.9e4 * np.sign(BIG.vertices + 0.01))
    with pytest.warns(FrozenBodyWarning):
        world.step(DT, 4)
    assert a.is_frozen
    b.set_linear_damping(5.0)
    for _ in range(240):
        world.step(DT)
    assert not b.is_frozen
    assert a.positions().tobytes() == where.tobytes()
    np.testing.assert_allclose(b.positions()[TOP], where[BOTTOM], atol=1e-4)
    weight = b.masses.sum() * G
    np.testing.assert_allclose(joint.force, [0, 0, weight], atol=1e-2 * weight)
    np.testing.assert_allclose(hold.force, [0, 0, -weight], atol=1e-2 * weight)
    assert joint.force[2] == pytest.approx(1000 * G, rel=0.01)


def rolled(world, ticks):
    hashes = []
    for _ in range(ticks):
        world.step(DT)
        hashes.append(world.state_hash())
    return hashes


def test_a_snapshot_carries_joints_to_the_bit(empty):
    world, kind = empty
    a = world.spawn(kind, position=(0, 0, 3.0))
    b = world.spawn(kind, position=(0, 0, 2.0))
    c = world.spawn(kind, position=(0, 0, 1.0))
    first = b.attach_to(a, TOP[:3])
    joint = c.attach_to(b, TOP)
    first.release()  # so that later rows move up
    rolled(world, 5)
    data, force, moving = world.snapshot(), joint.force, c.velocities()
    with_joint = rolled(world, 40)
    joint.release()
    again = c.attach_to(a, [0], onto=[5])
    assert rolled(world, 40) != with_joint
    world.restore(data)
    assert world.snapshot() == data
    assert joint.is_attached
    assert not again.is_attached
    assert (joint.body, joint.other, joint.particles.tolist()) == (c, b, TOP.tolist())
    np.testing.assert_array_equal(joint.force, force)
    np.testing.assert_array_equal(c.velocities(), moving)
    assert rolled(world, 40) == with_joint
    world.restore(data)
    names = {world.state_hash()}
    joint.release()
    names.add(world.state_hash())
    assert len(names) == 2


@pytest.mark.soak
def test_a_recording_makes_joints_again(empty, tmp_path):
    world, kind = empty
    a = world.spawn(kind, position=(0, 0, 3.0))
    b = world.spawn(kind, position=(0, 0, 2.0))
    joint = b.attach_to(a, TOP)
    rolled(world, 5)
    joint.release()
    b.attach_to(a, [13], onto=[2])
    rolled(world, 5)
    told = replay(world.save_recording(tmp_path / "joints.recording"))
    assert told.world.state_hash() == world.state_hash()
