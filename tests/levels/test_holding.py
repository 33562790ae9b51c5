"""Changes of level while a body is held: grabs continue, and constraints without a vertex are released."""

from functools import cache

import numpy as np
import pytest

from taichi_soft import (
    ContactBegan,
    Event,
    Material,
    OptionError,
    Released,
    SoftBodyAsset,
    StateError,
    box,
)
from taichi_soft.bodies.soft_body import record_of
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

RUBBER = Material(young=8e4, poisson=0.4, density=900.0)
BAR = [box((1.2, 0.3, 0.25), cells) for cells in ((16, 4, 4), (8, 3, 2), (5, 2, 2))]
WEIGHT = 9.80665 * 900.0 * 1.2 * 0.3 * 0.25
DT = 1 / 60


@cache
def kind():
    """Return the bar with its levels. It is not made while tests are only collected."""
    return SoftBodyAsset(BAR[0], RUBBER).with_coarser(*BAR[1:])


def nearest(point):
    """Return the triangle of the finest surface that is near a point, and its corner nearest to the point."""
    middles = BAR[0].vertices[BAR[0].surface].mean(axis=1)
    triangle = int(np.argmin(np.linalg.norm(middles - point, axis=1)))
    corner = np.argmin(np.linalg.norm(BAR[0].vertices[BAR[0].surface[triangle]] - point, axis=1))
    return triangle, np.eye(3)[corner]


def floating(**options):
    """Return a bar and a second bar above it, without gravity."""
    world = bare_world(**{"floor": None, "gravity": (0, 0, 0), "collider_room": 1, **options})
    bodies = [world.add_body(kind(), position=(0, 0, z)) for z in (2.0, 2.26)]
    world.build()
    return world, *bodies


@pytest.fixture(scope="module")
def made():
    world, *bodies = floating()
    world.record_events()
    return world, bodies, world.snapshot()


@pytest.fixture
def pair(made):
    """Return both bars in their initial state, without gravity."""
    world, bodies, start = made
    world.restore(start)
    world.drain_events()
    return world, *bodies


def moments(body):
    m, x, v = body.masses[:, None], body.positions().astype(np.float64), body.velocities().astype(np.float64)
    return np.array([(m * v).sum(axis=0), (m * np.cross(x, v)).sum(axis=0)])


def joined(world, low, high):
    """Constrain a bar by a joint, a motor and an attachment."""
    near = np.flatnonzero((BAR[0].vertices[:, 2] > 0.12) & (BAR[0].vertices[:, 0] > 0.5))
    joint = low.attach_to(high, near)
    motor = world.add_motor(low, np.arange(20), axis=(1, 0, 0), speed=3.0, max_torque=2.0)
    frame = world.add_frame(position=(-0.6, 0, 2))
    hold = low.attach(np.flatnonzero(BAR[0].vertices[:, 0] == BAR[0].vertices[:, 0].min()), frame)
    return joint, motor, hold


def test_a_hand_carries_the_weight_before_and_after_a_change_and_the_body_stays_under_it():
    """m g; the vertex that it holds hangs g / omega^2 below its target, before and after."""
    world = bare_world(floor=None)
    body = world.add_body(kind(), position=(0, 0, 2))
    world.build()
    body.set_linear_damping(8.0)
    triangle, corner = nearest([0, 0, 0.125])
    hand = body.grab(triangle, corner, frequency=1.5)
    vertex = BAR[0].surface[triangle] @ corner.astype(int)
    target, heights = hand.point, []
    for level in (0, 2, 1, 0):
        before, force = body.center_of_mass(), hand.force
        body.set_level(level)
        assert (hand.force == force).all()
        world.step(DT)
        if level or heights:
            assert hand.force == pytest.approx([0, 0, WEIGHT], abs=0.1 * WEIGHT)
            assert np.abs(body.center_of_mass() - before).max() < 2e-3
        for _ in range(300):
            world.step(DT)
        assert hand.is_held
        assert (hand.point == target).all()
        assert hand.force == pytest.approx([0, 0, WEIGHT], abs=0.01 * WEIGHT)
        assert np.abs(body.center_of_mass()[:2] - target[:2]).max() < 0.06
        heights.append(body.center_of_mass()[2])
        if level == 0:
            sag = target - body.positions()[vertex]
            assert sag == pytest.approx([0, 0, 9.80665 / (3 * np.pi) ** 2], abs=2e-3)
    assert heights == pytest.approx([heights[0]] * 4, abs=0.04)  # it bends by 0.1 m


@pytest.mark.parametrize("way", [(1,), (2,), (2, 1, 0)])
def test_a_change_under_a_hand_keeps_momentum_and_spin_and_the_next_pull_is_what_the_body_gets(pair, way):
    world, body, _ = pair
    body.set_velocity((1.0, -2.0, 0.5), (3.0, 1.0, -2.0))
    hand = body.grab(*nearest([0.6, 0, 0]))
    hand.move(hand.point + np.array([0.3, 0.2, 0.4]))
    for _ in range(5):
        world.step(DT)
    before = moments(body)
    for level in way:
        body.set_level(level)
    assert np.abs(moments(body) - before).max() < 2e-5 * np.abs(before).max()
    world.step(1e-3, 1)
    gained = (moments(body) - before)[0]
    assert gained == pytest.approx(1e-3 * hand.force, abs=2e-3)
    assert np.abs(gained).max() > 0.05


def test_a_hand_pulls_at_the_same_point_of_a_bent_body_and_comes_back_to_it(pair):
    """The force of its spring: m omega^2 times the way from where the motion takes the point at rest."""
    world, body, _ = pair
    triangle, weights = nearest([0.5, 0.1, 0.125])[0], np.array([0.2, 0.3, 0.5])
    place = weights @ BAR[0].vertices[BAR[0].surface[triangle]]
    stretch = np.array([[1.02, 0.05, 0.0], [-0.04, 0.99, 0.03], [0.02, 0.0, 1.01]])
    hand = body.grab(triangle, weights, frequency=0.5)
    target = hand.point + np.array([0.02, 0.0, 0.03])
    hand.move(target)
    for level in (1, 2, 0, 2, 0):
        body.set_level(level)
        rest = BAR[level].vertices
        body.set_motion(rest @ stretch.T + [0, 0, 2], 0 * rest)
        world.step(1e-6, 1)
        pull = body.masses.sum() * np.pi**2 * (target - stretch @ place - [0, 0, 2])
        assert hand.force == pytest.approx(pull, abs=1e-3 * np.linalg.norm(pull))


def test_a_hand_keeps_its_strongest_pull_and_lets_go_at_another_level(pair):
    world, body, _ = pair
    hand = body.grab(*nearest([0, 0, 0.125]), max_force=70.0)
    hand.move((5.0, 0.0, 2.0))
    for level in (2, 0, 1):
        body.set_level(level)
        world.restore(world.snapshot())
        world.step(1e-3, 1)
        assert np.linalg.norm(hand.force) == pytest.approx(70.0, rel=1e-3)
    hand.release()
    before = body.momentum()
    world.step(DT)
    assert body.momentum() == pytest.approx(before, abs=1e-3)


def test_two_hands_of_a_body_go_on_and_that_of_another_body_is_left_alone(pair):
    world, body, other = pair
    hands = [body.grab(*nearest([x, 0, 0.125])) for x in (-0.5, 0.5)]
    elsewhere = other.grab(*nearest([0, 0, 0.125]))
    hands[0].move(hands[0].point + np.array([0, 0, -0.02]))
    hands[1].move(hands[1].point + np.array([0, 0, -0.04]))
    elsewhere.move(elsewhere.point + np.array([0.1, 0, 0]))
    body.set_level(2)
    before = body.momentum(), other.momentum()
    world.step(1e-3, 1)
    pull = sum(hand.force for hand in hands)
    assert (body.momentum() - before[0]) == pytest.approx(1e-3 * pull, abs=1e-4)
    assert (other.momentum() - before[1]) == pytest.approx(1e-3 * elsewhere.force, abs=1e-4)
    assert hands[1].force[2] == pytest.approx(2 * hands[0].force[2], rel=0.02)


def test_joints_and_motors_bar_a_change_that_may_not_release_them_and_nothing_is_changed(pair):
    world, low, high = pair
    held = joined(world, low, high)
    before = world.state_hash(), 0, low.topology_version
    for body, names in ((low, "joints and motors"), (high, "joints")):
        with pytest.raises(StateError, match=f"{names}.*release=True"):
            body.set_level(1)
    with pytest.raises(OptionError, match="level is 3"):
        low.set_level(3, release=True)
    with pytest.raises(OptionError, match=r"release.*True.*False.*1"):
        low.set_level(1, release=1)
    low.set_level(0, release=True)  # its current level
    assert (world.state_hash(), low.level, low.topology_version) == before
    assert [held[0].is_attached, held[1].is_mounted, held[2].is_attached] == [True] * 3
    assert world.drain_events() == []


def test_what_has_no_place_is_released_and_told_of_and_what_has_one_stays(pair):
    """The state agrees bit by bit with that after a release by hand."""
    world, low, high = pair
    joint, motor, hold = joined(world, low, high)
    high.set_velocity((0.5, 1.0, 0.0))
    hand, other = low.grab(*nearest([0.5, 0, 0.0])), high.grab(*nearest([0, 0, 0.1]))
    for _ in range(3):
        world.step(DT)
    start, time = world.snapshot(), world.time
    joint.release()
    motor.remove()
    low.set_level(2)
    by_hand = world.state_hash(), moments(high).tobytes()
    world.restore(start)
    low.set_level(2, release=True)
    assert (world.state_hash(), moments(high).tobytes()) == by_hand
    assert (joint.is_attached, motor.is_mounted) == (False, False)
    assert (hold.is_attached, hand.is_held, other.is_held) == (True, True, True)
    (event,) = (each for each in world.drain_events() if isinstance(each, Released))
    assert (event.body, event.handles) == (low, (joint, motor))
    assert (event.step, event.time) == (3, time)
    low.set_level(0, release=True)
    world.step(DT)
    assert not [each for each in world.drain_events() if isinstance(each, Released)]


def test_an_attachment_without_a_vertex_is_released_where_it_may_be_and_others_hang_on(pair):
    world, body, _ = pair
    frames = [world.add_frame(position=(x, 0, 2)) for x in (-0.6, 0.6)]
    near = BAR[2].vertices[np.argmin(np.linalg.norm(BAR[2].vertices, axis=1))]
    first, second = np.argsort(np.linalg.norm(BAR[0].vertices - near, axis=1))[:2]
    stays, goes = body.attach([first], frames[0]), body.attach([second], frames[1])
    before = world.state_hash()
    with pytest.raises(StateError, match="nothing at level 2"):
        body.set_level(2)
    assert record_of(body).held is None
    assert (world.state_hash(), body.level) == (before, 0)
    body.set_level(2, release=True)
    assert (stays.is_attached, goes.is_attached) == (True, False)
    assert body.pinned.tolist() == stays.particles.tolist()
    (event,) = world.drain_events()
    assert (type(event), event.body, event.handles) == (Released, body, (goes,))


def test_a_release_that_is_undone_is_not_told_of_and_holds_again(pair):
    world, low, high = pair
    joint, motor, _ = joined(world, low, high)
    low.grab(*nearest([0.5, 0, 0.0])).move((1.0, 0, 2.2))
    world.step(DT)
    start, told, ends = world.snapshot(), [], []
    for undone in (True, False):
        low.set_level(2, release=True)
        for _ in range(10):
            world.step(DT)
        ends.append(world.state_hash())
        if undone:
            world.restore(start)
            assert (joint.is_attached, motor.is_mounted, low.level) == (True, True, 0)
    told = [(each.step, each.handles) for each in world.drain_events() if isinstance(each, Released)]
    assert told == [(1, (joint, motor))]
    assert ends[0] == ends[1]


def test_a_listener_hears_of_what_was_released_and_who_records_other_kinds_does_not(pair):
    world, low, high = pair
    heard = []
    listener = world.on(Released, heard.append)
    joint, motor, _ = joined(world, low, high)
    low.set_level(1, release=True)
    world.drain_events()
    assert [event.handles for event in heard] == [(joint, motor)]
    listener.remove()
    world.record_events([ContactBegan])
    world.add_motor(high, np.arange(20), axis=(1, 0, 0), speed=3.0, max_torque=2.0)
    high.set_level(1, release=True)
    assert world.drain_events() == []
    world.record_events([Event])


@pytest.mark.soak
def test_recordings_make_changes_under_a_hand_and_releases_again(tmp_path):
    world, low, high = floating(record=100, gravity=(0, 0, -9.81), floor=0.0)
    joined(world, low, high)
    hand = low.grab(*nearest([0.5, 0, 0.0]))
    for tick in range(40):
        hand.move(hand.point + np.array([0, 0.01, 0.01]))
        if tick == 10:
            with pytest.raises(StateError, match="name its vertices"):
                low.set_level(2)
        if tick in (12, 20, 30):
            low.set_level({12: 2, 20: 1, 30: 0}[tick], release=tick == 12)
        world.step(DT)
    report = replay(world.save_recording(tmp_path / "hand.recording"))
    assert report.first_difference is None
    assert report.steps == 40
    assert report.world.state_hash() == world.state_hash()
    (again,) = report.world.grabs
    assert (again.force == hand.force).all()
