"""Bodies that stand still for a step: what a skipped step leaves, and who makes it after all."""

from itertools import pairwise

import numpy as np
import pytest

from taichi_soft import (
    ContactBegan,
    ContactEnded,
    FellAsleep,
    Material,
    OptionError,
    SphereShape,
    StateError,
    Woke,
    box,
)
from taichi_soft.render.replay import replay
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

DT = 1 / 60
EDGE = 0.5
BLOCK = box((EDGE,) * 3, (2, 2, 2))
SOFT = Material(1e5, 0.3, 1000.0, 20.0)
FAR = np.array([40.0, 0.0, 0.0])
WORLDS = {
    "each by itself": {},
    "flat": {"schedule": "flat"},
    "implicit": {"integrator": "implicit_euler", "collider_room": 1},
    "in contact": {"soft_contact": True, "collider_room": 1},
}


def motion(body):
    return body.positions().tobytes(), body.velocities().tobytes()


@pytest.fixture(params=WORLDS.values(), ids=WORLDS)
def thrown(request):
    """Two blocks above the floor that do not meet: both turn and fall."""
    world = bare_world(**request.param)
    world.reserve(world.add_body(BLOCK, SOFT, position=(*FAR[:2], 0.5)).asset, 1)
    body = world.spawn(
        world.bodies[0].asset, position=(0, 0, 0.5), velocity=(1, 0, 0), angular_velocity=(1, 2, 3)
    )
    world.build()
    return world, body


def test_a_body_that_skips_steps_moves_as_it_would_bit_for_bit_but_later(thrown):
    world, body = thrown
    start, seen, others = world.snapshot(), [], []
    for _ in range(20):
        world.step(DT)
        seen.append(motion(body))
        others.append(motion(world.bodies[0]))
    world.restore(start)
    for k in range(40):
        before = motion(body)
        if k % 2 == 0:
            world.skip_step([body])
        world.step(DT)
        assert motion(body) == (before if k % 2 == 0 else seen[k // 2])
        if k < 20:
            assert motion(world.bodies[0]) == others[k], "nobody else minds"
    assert body.positions()[:, 2].min() < 0.02, "it came down on the floor meanwhile"


def test_it_is_drawn_where_it_stands_through_a_skipped_step(thrown):
    world, body = thrown
    world.step(DT)
    world.skip_step([body])
    world.step(DT)
    for alpha in (0.0, 0.5, 1.0):
        np.testing.assert_array_equal(world.read_positions(body, alpha), body.positions())
    before = body.positions()
    world.step(DT)
    np.testing.assert_array_equal(world.read_positions(body, 0.0), before)
    assert np.abs(world.read_positions(body, 1.0) - before).max() > 1e-3


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A pile of two, a third far away in the air, in a world that records; and its snapshot."""
    path = tmp_path_factory.mktemp("skips") / "frozen.recording"
    world = bare_world(soft_contact=True, sleep_speed=0.05, collider_room=1, record=400, record_to=path)
    for place in ((0, 0, 0.25), (0, 0, 0.78), 2 * FAR + (0, 0, 3.0)):
        world.add_body(BLOCK, SOFT, position=place)
    world.build()
    for _ in range(6):
        world.step(DT)
    return world, world.snapshot()


@pytest.fixture
def pile(built):
    world, before = built
    for collider in world.colliders[1:]:
        collider.remove()
    world.set_force_field(None)
    world.record_events(())
    world.restore(before)
    return world


def stood_still(world, act=lambda: None):
    """Return for each body True if a step left it in place."""
    before = [body.positions() for body in world.bodies]
    act()
    world.step(DT)
    return [np.array_equal(body.positions(), x) for body, x in zip(world.bodies, before, strict=True)]


def test_who_may_touch_each_other_are_an_island_and_who_is_far_away_is_one(pile):
    below, above, alone = pile.bodies
    assert pile.islands == [(below, above), (alone,)]
    data = pile.snapshot()
    alone.teleport((0, 0, 1.4))
    pile.step(DT)
    assert pile.islands == [(below, above, alone)]
    pile.restore(data)
    assert pile.islands == [(below, above), (alone,)]


def test_an_island_skips_a_step_together_or_not_at_all(pile):
    below, above, alone = pile.bodies
    start = pile.snapshot()
    pile.step(DT)
    expected = [motion(body) for body in pile.bodies]
    for chosen in ([below], [above]):
        pile.restore(start)
        assert stood_still(pile, lambda chosen=chosen: pile.skip_step(chosen)) == [False] * 3
        assert [motion(body) for body in pile.bodies] == expected
    pile.restore(start)
    assert stood_still(pile, lambda: (pile.skip_step([below]), pile.skip_step((above,)))) == [
        True,
        True,
        False,
    ]
    assert motion(alone) == expected[2]
    pile.step(DT)
    assert [motion(body) for body in (below, above)] == expected[:2]


def test_a_step_that_all_skip_is_followed_by_one_in_which_all_move(pile):
    assert stood_still(pile, lambda: pile.skip_step(list(pile.bodies))) == [True] * 3
    assert stood_still(pile) == [False] * 3


def test_what_pushes_or_moves_it_makes_it_step_after_all(pile):
    alone = pile.bodies[2]
    data = pile.snapshot()

    def skip():
        pile.skip_step([alone])

    def push():
        alone.apply_force((0, 0, 1.0))

    def move_a_ball(place):
        ball = pile.add_collider(SphereShape(0.2), position=(*place[:2], 3.42))
        ball.set_velocity((0, 0, -1.0))
        skip()
        pile.step(DT)
        ball.remove()

    def attach():
        alone.attach([0], pile.add_frame(alone.positions()[0]))

    def aim():
        alone.pin([0])
        alone.set_targets([0], alone.positions()[:1] + 0.01)

    for acts in ((push, skip), (skip, push), (attach, skip), (skip, attach), (aim, skip), (skip, aim)):
        pile.restore(data)
        assert not stood_still(pile, lambda acts=acts: [act() for act in acts])[2], acts
    for place, expected in ((2 * FAR, False), (3 * FAR, True)):
        pile.restore(data)
        before = alone.positions()
        move_a_ball(place)
        assert np.array_equal(alone.positions(), before) == expected


@pytest.mark.parametrize("is_restored", [False, True])
def test_who_is_put_beside_a_moving_collider_after_it_was_told_to_skip_makes_the_step(pile, is_restored):
    """Two blocks in the air, told to skip: the ball flies beside the one place, where one of them is put."""
    alone, elsewhere = pile.bodies[2], 3 * FAR + (0, 0, 3.0)
    ball = pile.add_collider(SphereShape(0.2), position=np.add(elsewhere, (0, 0, 0.48)))
    ball.set_velocity((0, 0, -6.0))
    pile.skip_step([alone])
    alone.teleport(elsewhere)
    if is_restored:  # who restores has not been told where the boxes were
        data = pile.snapshot()
        pile.step(DT)
        pile.restore(data)
    before = alone.positions()
    pile.step(DT)
    assert not np.array_equal(alone.positions(), before)
    assert ball.impulse[2] > 0.0


def test_who_is_put_away_from_a_moving_collider_after_it_was_told_to_skip_stands_still(pile):
    alone = pile.bodies[2]
    ball = pile.add_collider(SphereShape(0.2), position=2 * FAR + (0, 0, 3.48))
    ball.set_velocity((0, 0, -2.0))
    pile.skip_step([alone])
    alone.teleport(3 * FAR + (0, 0, 3.0))
    assert stood_still(pile)[2]


def test_an_impulse_counts_in_the_step_after_and_a_field_acts_in_the_steps_that_are_made(pile):
    alone = pile.bodies[2]
    data = pile.snapshot()
    mass = alone.masses.sum()
    before = alone.momentum()
    pile.skip_step([alone])
    alone.apply_impulse((3.0, 0, 0))
    pile.step(DT)
    pile.step(DT)
    assert alone.momentum() - before == pytest.approx([3.0, 0, -9.80665 * DT * mass], abs=1e-3 * mass)
    pile.restore(data)
    pile.set_force_field(lambda positions, time: np.full_like(positions, 7.0))
    for k in range(8):
        if k % 4:
            pile.skip_step([alone])
        pile.step(DT)
    gained = (alone.momentum() - before) / mass
    assert gained == pytest.approx(2 * DT * np.array([7.0, 7.0, 7.0 - 9.80665]), abs=1e-3)


def test_a_snapshot_between_the_call_and_the_step_has_it(pile):
    pile.skip_step([pile.bodies[2]])
    data, name = pile.snapshot(), pile.state_hash()
    assert stood_still(pile) == [False, False, True]
    after = pile.state_hash()
    pile.step(DT)
    pile.restore(data)
    assert pile.state_hash() == name
    assert stood_still(pile) == [False, False, True]
    assert pile.state_hash() == after


def test_a_recording_makes_skipped_steps_again(pile, tmp_path):
    rng = np.random.default_rng(3)
    for _ in range(40):
        pile.skip_step([body for body in pile.bodies if rng.random() < 0.7])
        pile.step(DT)
    report = replay(pile.save_recording(tmp_path / "skips.recording"))
    assert report.first_difference is None
    assert report.world.state_hash() == pile.state_hash()


def test_no_event_tells_of_skipped_steps(pile):
    """Contacts persist although three of four steps are skipped, and no body falls asleep or wakes."""
    pile.record_events((ContactBegan, ContactEnded, FellAsleep, Woke))
    for _ in range(6):
        pile.step(DT)
    assert {type(event) for event in pile.drain_events()} == {ContactBegan}
    for k in range(40):
        if k % 4:
            pile.skip_step(list(pile.bodies))
        pile.step(DT)
        assert [body.is_asleep for body in pile.bodies] == [False] * 3
    assert not pile.drain_events()


def test_a_pile_that_skips_steps_falls_asleep_in_its_own_time(pile):
    """Skipped steps do not count as calm."""
    steps = {}
    data = pile.snapshot()
    for skips in (1, 2):
        pile.restore(data)
        steps[skips] = 0
        while not pile.bodies[0].is_asleep:
            if steps[skips] % skips:
                pile.skip_step(list(pile.bodies[:2]))
            pile.step(DT)
            steps[skips] += 1
    assert steps[2] == 2 * steps[1] - 1


def test_who_sleeps_sleeps_on(pile):
    while not pile.bodies[0].is_asleep:
        pile.step(DT)
    before = [motion(body) for body in pile.bodies[:2]]
    pile.skip_step([pile.bodies[0]])
    assert pile.bodies[0].is_asleep
    pile.step(DT)
    assert [body.is_asleep for body in pile.bodies[:2]] == [True, True]
    assert [motion(body) for body in pile.bodies[:2]] == before


@pytest.mark.parametrize("bodies", [None, 3, "bodies", [0], [None]])
def test_what_is_no_list_of_bodies_is_refused(pile, bodies):
    name = pile.state_hash()
    with pytest.raises(OptionError, match="bod"):
        pile.skip_step(bodies)
    assert pile.state_hash() == name


def test_a_removed_body_and_a_world_that_is_not_built_are_refused(pile):
    gone = pile.bodies[0]
    pile.despawn(gone)
    name = pile.state_hash()
    with pytest.raises(StateError, match="removed"):
        pile.skip_step([pile.bodies[0], gone])
    assert pile.state_hash() == name
    world = bare_world()
    body = world.add_body(BLOCK, SOFT, position=(0, 0, 1))
    with pytest.raises(StateError, match="not built"):
        world.skip_step([body])
    with pytest.raises(StateError, match="not built"):
        _ = world.islands


def test_joined_bodies_are_an_island_without_contact_between_bodies():
    world = bare_world(collider_room=1)
    bodies = [world.add_body(BLOCK, SOFT, position=(x, 0, 3.0)) for x in (0.0, EDGE, 9.0)]
    world.build()
    assert world.islands == [(body,) for body in bodies]
    right = np.flatnonzero(BLOCK.vertices[:, 0] > 0.2)
    left = np.flatnonzero(BLOCK.vertices[:, 0] < -0.2)
    joint = bodies[0].attach_to(bodies[1], right, onto=left)
    world.step(DT)
    assert world.islands == [(bodies[0], bodies[1]), (bodies[2],)]
    assert stood_still(world, lambda: world.skip_step([bodies[0]])) == [False] * 3
    assert stood_still(world, lambda: world.skip_step(bodies[:2])) == [True, True, False]
    joint.release()
    assert stood_still(world, lambda: world.skip_step([bodies[0]])) == [True, False, False]
    apart = [np.linalg.norm(b.center_of_mass() - a.center_of_mass()) for a, b in pairwise(world.bodies)]
    assert min(apart) > 0.3


@pytest.mark.parametrize(("is_beside", "moves"), [(True, True), (False, False)])
def test_where_nobody_sleeps_a_skipper_that_is_teleported_is_looked_for_where_it_is(is_beside, moves):
    """A ball flies at the place where it is put, or at the one that it left."""
    world = bare_world(soft_contact=True, sleep_speed=0.0, collider_room=1, gravity=(0, 0, 0))
    body = world.add_body(BLOCK, SOFT, position=(0, 0, 3))
    world.build()
    world.step(DT)
    there = np.add(FAR, (0, 0, 3))
    target = there if is_beside else np.array([0.0, 0.0, 3.0])
    ball = world.add_collider(SphereShape(0.2), position=np.add(target, (0, 0, 0.48)))
    ball.set_velocity((0, 0, -2.0))
    world.skip_step([body])
    body.teleport(there)
    before = body.positions()
    world.step(DT)
    assert np.array_equal(body.positions(), before) != moves
    assert (ball.impulse[2] > 0.0) == moves
