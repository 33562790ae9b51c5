"""`World.shift_origin`: the same world in other coordinates."""

import numpy as np
import pytest

from taichi_soft import BoxShape, Material, OptionError, SoftBodyAsset, SphereShape, StateError, World, box
from taichi_soft.world.bare import bare_world

DT = 1 / 64
JELLY = Material(young=6e4, poisson=0.3, density=500.0, damping_ratio=0.2)
CUBE = box((0.5, 0.5, 0.5), (2, 2, 2))
TOP = np.flatnonzero(CUBE.vertices[:, 2] > 0.24)
BOTTOM = np.flatnonzero(CUBE.vertices[:, 2] < -0.24)
OFFSET = np.array([256.0, -512.0, 32.0])


def everything():
    """A body of each kind: pinned, attached, joined, grabbed, driven, on a lift, on the floor."""
    world = bare_world(floor=0.0, collider_room=3, soft_contact=True, sleep_speed=0.02)
    asset = SoftBodyAsset(CUBE, JELLY)
    world.reserve(asset, 9)
    places = ((0, 0, 2), (2, 0, 2), (2, 0, 1.5), (4, 0, 2), (6, 0, 0.26), (8, 0, 0.46), (10, 0, 0.26))
    bodies = [world.spawn(asset, position=place) for place in places]
    lift = world.add_collider(BoxShape((1, 1, 0.2)), position=(8, 0, 0.1))
    world.add_collider(SphereShape(0.3), position=(12, 0, 1))
    world.build()
    pinned, held, hanging, pulled, driven = bodies[:5]
    pinned.pin(TOP)
    hand = world.add_frame((2, 0, 2.25))
    held.attach(TOP, hand, two_way=True)
    hanging.attach_to(held, TOP, onto=BOTTOM)
    pulled.grab(0)
    world.add_motor(driven, TOP, (0, 0, 1), speed=1.0, max_torque=20.0, is_fixed=True, point=(6, 0, 0))
    return world, lift, hand


def drive(world, lift, hand, step, origin):
    """The inputs of a game before a step, in the coordinates of the world."""
    pinned, pulled = world.bodies[0], world.grabs[0]
    pinned.set_targets(TOP, CUBE.vertices[TOP] + (0.002 * step, 0, 2) - origin)
    hand.move_to(np.array([2 + 0.003 * step, 0, 2.25]) - origin)
    pulled.move(np.array([4, 0.001 * step, 2.5]) - origin)
    lift.move_to(np.array([8, 0, 0.1 + 0.002 * step]) - origin)


def state(world, origin, *, between=True):
    """All that a game reads, in the first coordinates; with positions between the last two steps."""
    rows = [body.positions().astype(float) + origin for body in world.bodies]
    if between:
        rows += [world.read_positions(body, 0.25).astype(float) + origin for body in world.bodies]
    rows += [each.position + origin for each in world.colliders if each.shape != world.floor_collider.shape]
    rows += [each.position.astype(float) + origin for each in world.frames]
    rows += [each.point + origin for each in world.grabs]
    return [np.atleast_2d(each) for each in rows]


@pytest.fixture(scope="module")
def whole():
    return everything()


@pytest.mark.parametrize("moves", [False, True])
def test_the_motion_after_a_shift_is_that_without_it(whole, moves):
    world, lift, hand = whole
    begun = world.snapshot()
    found = []
    for offset in (np.zeros(3), OFFSET):
        world.restore(begun)
        origin = np.zeros(3)
        for step in range(40):
            if step == 15 and offset.any():
                before, hash_before = state(world, origin), world.bodies_hash()
                world.shift_origin(offset)
                origin = origin + offset
                for a, b in zip(before, state(world, origin), strict=True):
                    np.testing.assert_allclose(a, b, atol=2e-4)  # float32 at 512 m
                assert world.bodies_hash() != hash_before
            if moves:
                drive(world, lift, hand, step, origin)
            world.step(DT, 8)
        found.append(state(world, origin))
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(a, b, atol=2e-3)
    world.restore(begun)


def test_a_shift_to_the_origin_and_its_snapshot_are_exact(whole):
    """Coordinates near an offset of a power of two have fewer bits than those near zero."""
    world, *_ = whole
    begun = world.snapshot()
    world.shift_origin(-OFFSET)
    far, kept = state(world, np.zeros(3), between=False), world.snapshot()
    world.shift_origin(OFFSET)
    for a, b in zip(far, state(world, OFFSET, between=False), strict=True):
        np.testing.assert_array_equal(a, b)
    assert world.settings.floor == 0.0
    world.restore(kept)
    assert world.settings.floor == 32.0
    assert world.floor_collider.position.tolist() == OFFSET.tolist()
    for a, b in zip(far, state(world, np.zeros(3), between=False), strict=True):
        np.testing.assert_array_equal(a, b)
    world.restore(begun)
    assert world.settings.floor == 0.0


def test_a_body_that_tumbles_in_the_same_binade_moves_to_the_same_bits():
    """From [4, 8) to [-8, -4), where float32 has the same spacing, each sum rounds in the same way."""
    runs = []
    for shifts in (False, True):
        world = bare_world(floor=None, gravity=(0, 0, 0), collider_room=0)
        body = world.add_body(CUBE, JELLY, position=(6, 6, 6))
        world.build()
        body.set_velocity((0.2, -0.1, 0.1), (3.0, 2.0, 1.0))
        for step in range(64):
            if shifts and step == 20:
                world.shift_origin((12.0, 12.0, 12.0))
            world.step(DT, 8)
        runs.append((body.positions(), body.velocities()))
    (x, v), (moved_x, moved_v) = runs
    assert np.abs(x - 6).max() < 1.5
    np.testing.assert_array_equal(moved_x.astype(float) + 12.0, x)
    np.testing.assert_array_equal(moved_v, v)


def test_sleeping_bodies_stay_asleep_and_keep_their_shapes_to_the_bit():
    world = World(floor=64.0)
    asset = SoftBodyAsset(CUBE, JELLY)
    world.reserve(asset, 3)
    bodies = [world.spawn(asset, position=(128 + 2 * i, 32, 64.26)) for i in range(2)]
    world.build()
    for _ in range(1200):
        world.step(DT)
        if all(body.is_asleep for body in bodies):
            break
    assert all(body.is_asleep for body in bodies)
    before = [body.exact_positions() for body in bodies]
    world.shift_origin((128.0, 32.0, 64.0))
    for _ in range(100):
        world.step(DT)
    for body, x in zip(bodies, before, strict=True):
        assert body.is_asleep
        np.testing.assert_array_equal(body.exact_positions(), x - (128, 32, 64))
    late = world.spawn(asset, on_floor=True, position=(3.0, 0.0, 0.0))
    assert late.positions()[:, 2].min() == pytest.approx(0.0, abs=1e-4)
    bodies[0].apply_impulse((0.0, 0.0, 1.0))
    for _ in range(60):
        world.step(DT)
    assert bodies[0].positions()[:, 2].min() > -0.005


def test_rays_find_bodies_and_colliders_at_their_new_places(whole):
    world, *_ = whole
    begun = world.snapshot()
    ray = world.raycast((8.1, 0.05, 5), (0, 0, -1), colliders=True)
    ball = world.raycast((12.0, 0.0, 5.0), (0, 0, -1), colliders=True)
    world.shift_origin(OFFSET)
    shifted = world.raycast(np.array([8.1, 0.05, 5]) - OFFSET, (0, 0, -1), colliders=True)
    assert shifted.body is ray.body
    assert shifted.distance == pytest.approx(ray.distance, abs=1e-4)
    shifted = world.raycast(np.array([12.0, 0.0, 5.0]) - OFFSET, (0, 0, -1), colliders=True)
    assert shifted.collider is ball.collider
    assert shifted.distance == pytest.approx(ball.distance, abs=1e-4)
    world.restore(begun)


def test_bad_offsets_are_refused_and_change_nothing(whole):
    world, *_ = whole
    before = world.state_hash()
    for bad in ((1, 2), (float("nan"), 0, 0), "far", (-9999999.0, 0, 0), (1e9, 0, 0)):
        with pytest.raises(OptionError, match="offset"):
            world.shift_origin(bad)
    assert world.state_hash() == before
    with pytest.raises(StateError, match="build"):
        World().shift_origin((1, 0, 0))


def test_a_world_of_the_flat_schedule_shifts_its_floor_too():
    world = World(schedule="flat", floor=0.0)
    body = world.add_body(CUBE, JELLY, position=(0, 0, 1))
    world.build()
    world.shift_origin((0.0, 0.0, 64.0))
    assert world.settings.floor == -64.0
    for _ in range(120):
        world.step(DT)
    assert body.positions()[:, 2].min() == pytest.approx(-64.0, abs=1e-3)
