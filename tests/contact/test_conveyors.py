"""Bodies on surfaces that move: conveyor belts, and drums that turn in place."""

import numpy as np
import pytest
from experiments import alone, turn

from taichi_soft import (
    BoxShape,
    CapsuleShape,
    Contact,
    Material,
    OptionError,
    PlaneShape,
    SoftBodyAsset,
    StateError,
    box,
)
from taichi_soft.world.bare import bare_world

G = 9.81
DT = 1 / 60
FIRM = Material(young=1e6, poisson=0.2, density=1000.0, damping=300.0, damping_ratio=0.0)
BLOCK = box((1.0, 1.0, 0.5), (2, 2, 1))
MU, SPEED = 0.3, 1.5


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def velocity_of(body):
    """Velocity of the centre of mass [m/s]."""
    return body.masses @ body.velocities().astype(np.float64) / body.masses.sum()


def hulled_block():
    """A block that touches colliders by the points of a hull of its own size."""
    fine = box((1.0, 1.0, 0.5), (4, 4, 2))
    return SoftBodyAsset(box((1.0, 1.0, 0.5), (2, 2, 1)), FIRM, hull=(fine.vertices, fine.surface))


KINDS = {"leapfrog": {}, "implicit_euler": {"integrator": "implicit_euler"}, "hull": {}}


@pytest.fixture(scope="module", params=[*KINDS])
def belts(request):
    """Return a built world: a block rests on each of two belts that stand still, one turned by 90 degrees."""
    world = bare_world(floor=None, sleep_speed=0.02, collider_room=8, **KINDS[request.param])
    asset = hulled_block() if request.param == "hull" else SoftBodyAsset(BLOCK, FIRM)
    for number, angle in enumerate((0.0, np.pi / 2)):
        place = (0.0, 50.0 * number, -0.1)
        about_z = turn(angle, (0.0, 0.0, 1.0))
        world.add_collider(BoxShape((40.0, 40.0, 0.2)), position=place, rotation=about_z, friction=MU)
        world.add_body(asset, position=(0.0, 50.0 * number, 0.25))
    world.build()
    run(world, 1.0)
    return world


@pytest.fixture
def resting(belts):
    """The world of `belts` as it was built, with snapshots undone by the next test."""
    kept = belts.snapshot()
    yield belts
    belts.restore(kept)


def test_a_block_reaches_the_speed_of_a_belt_after_v_over_mu_g_and_feels_mu_m_g_meanwhile(resting):
    belt, block = resting.colliders[0], resting.bodies[0]
    mass = block.masses.sum()
    belt.set_surface_velocity((SPEED, 0.0, 0.0))
    steps = int(0.9 * SPEED / (MU * G) / DT)
    impulse = np.zeros(3)
    for _ in range(steps):
        resting.step(DT)
        impulse += belt.impulse
        assert velocity_of(block)[0] < SPEED
    sliding = steps * DT
    np.testing.assert_allclose(velocity_of(block), [MU * G * sliding, 0.0, 0.0], atol=0.02 * SPEED)
    # The reaction on the belt: friction against its motion, and the weight of the block.
    np.testing.assert_allclose(impulse / sliding / (mass * G), [-MU, 0.0, -1.0], rtol=0.02, atol=0.01)
    run(resting, 0.25 * SPEED / (MU * G))
    np.testing.assert_allclose(velocity_of(block), [SPEED, 0.0, 0.0], atol=0.02 * SPEED)
    run(resting, 1.0)
    np.testing.assert_allclose(velocity_of(block), [SPEED, 0.0, 0.0], atol=0.01 * SPEED)
    assert not block.is_asleep


def test_the_velocity_turns_with_the_belt_and_its_part_along_the_normal_is_ignored(resting):
    """The second belt is turned by 90 degrees, so its x points along y."""
    belt, block = resting.colliders[1], resting.bodies[1]
    height = block.center_of_mass()[2]
    belt.set_surface_velocity((0.5, 0.0, 4.0))
    run(resting, 1.0)
    np.testing.assert_allclose(velocity_of(block), [0.0, 0.5, 0.0], atol=0.02)
    assert abs(block.center_of_mass()[2] - height) < 1e-3


def test_a_slow_belt_keeps_a_block_awake_and_carries_it_and_a_stopped_one_lets_it_sleep(resting):
    belt, block = resting.colliders[0], resting.bodies[0]
    assert block.is_asleep
    belt.set_surface_velocity((0.01, 0.0, 0.0))  # half of the speed below which bodies fall asleep
    run(resting, 1.0)
    begin = block.center_of_mass()[0]
    run(resting, 2.0)
    assert not block.is_asleep
    assert block.center_of_mass()[0] - begin == pytest.approx(0.02, rel=0.03)
    belt.set_surface_velocity((0.0, 0.0, 0.0))
    run(resting, 2.0)
    assert block.is_asleep
    assert resting.bodies[1].is_asleep  # on a belt that never moved


def test_a_restored_belt_carries_its_block_to_the_same_bits(resting):
    belt, block = resting.colliders[0], resting.bodies[0]
    belt.set_surface_velocity((SPEED, 0.2, 0.0))
    run(resting, 0.3)
    kept = resting.snapshot()
    run(resting, 0.3)
    expected = block.positions()
    belt.set_surface_velocity((-3.0, 0.0, 0.0))
    run(resting, 0.1)
    resting.restore(kept)
    np.testing.assert_array_equal(belt.surface_velocity, [SPEED, 0.2, 0.0])
    run(resting, 0.3)
    np.testing.assert_array_equal(block.positions(), expected)


@pytest.mark.parametrize("velocity", [(1.0, 0.0), (np.nan, 0.0, 0.0), (3e4, 0.0, 0.0), "fast"])
def test_a_surface_velocity_that_is_none_is_refused_and_changes_nothing(resting, velocity):
    belt = resting.colliders[0]
    with pytest.raises(OptionError, match="surface_velocity"):
        belt.set_surface_velocity(velocity)
    with pytest.raises(OptionError, match="surface_velocity"):
        resting.add_collider(PlaneShape(), surface_velocity=velocity)
    assert not belt.surface_velocity.any()
    assert len(resting.colliders) == 2
    gone = resting.add_collider(PlaneShape(), group=0)
    gone.remove()
    with pytest.raises(StateError, match="was removed"):
        gone.set_surface_velocity((1.0, 0.0, 0.0))


TILT = 0.25


def test_a_tilted_belt_carries_uphill_what_friction_can_hold_and_loses_what_it_cannot():
    """Uphill, friction gives the acceleration g (mu cos a - sin a). It is below 0 if mu < tan a."""
    tilt = turn(TILT, (0.0, 1.0, 0.0))  # down along +x
    world = bare_world(floor=None, collider_room=8)
    shares = (0.8, 1.5)
    for number, share in enumerate(shares):
        options = {"friction": share * np.tan(TILT), "surface_velocity": (-SPEED, 0.0, 0.0)}
        size = (80.0, 4.0, 0.1)
        world.add_collider(
            BoxShape(size), rotation=tilt, position=-0.05 * tilt[:, 2], **options, **alone(number)
        )
        world.add_body(
            BLOCK, FIRM, position=0.25 * tilt[:, 2], rotation=tilt, contact=Contact(**alone(number))
        )
    world.build()
    run(world, 0.5)  # sinks in
    before = [velocity_of(body) @ tilt[:, 0] for body in world.bodies]
    run(world, 0.5)
    for share, begin, body in zip(shares, before, world.bodies, strict=True):
        gained = velocity_of(body) @ tilt[:, 0] - begin
        assert gained == pytest.approx((1.0 - share) * G * np.sin(TILT) * 0.5, rel=0.05), share
    run(world, 2.0)
    loses, carried = (velocity_of(body) @ tilt[:, 0] for body in world.bodies)
    assert carried == pytest.approx(-SPEED, rel=0.02)
    assert loses > 1.0


def test_a_drum_that_turns_in_place_carries_a_block_at_the_speed_of_its_surface():
    """The speed of the surface is radius times spin, by `set_velocity`; no surface velocity is needed."""
    radius, speed = 5.0, 0.5
    world = bare_world(floor=None, collider_room=8)
    drum = world.add_collider(
        CapsuleShape(radius=radius, length=4.0),
        position=(0.0, 0.0, -radius),
        rotation=turn(np.pi / 2, (1.0, 0.0, 0.0)),
        friction=0.8,
    )
    block = world.add_body(box((0.4, 0.4, 0.1), (4, 4, 1)), FIRM, position=(0.0, 1.0, 0.06))
    world.build()
    run(world, 0.3)
    drum.set_velocity((0.0, 0.0, 0.0), (0.0, speed / radius, 0.0))
    run(world, 0.5)
    assert velocity_of(block)[0] == pytest.approx(speed, rel=0.05)
    np.testing.assert_array_equal(drum.position, [0.0, 0.0, -radius])


def test_a_belt_gives_the_momentum_and_angular_momentum_that_its_block_gains():
    """The tolerance is that of velocities, which leapfrog reads half a substep from the last impulse."""
    world = bare_world(floor=None, collider_room=8)
    belt = world.add_collider(
        BoxShape((40.0, 40.0, 0.2)), position=(0.0, 0.0, -0.1), surface_velocity=(1.0, -0.5, 0.0)
    )
    block = world.add_body(BLOCK, FIRM, position=(3.0, 2.0, 0.4))
    world.build()
    center, mass = np.array([0.0, 0.0, -0.1]), block.masses.sum()
    given, turned, weight_turned = np.zeros(3), np.zeros(3), np.zeros(3)
    weight = np.array([0.0, 0.0, -G]) * mass * DT
    for _ in range(60):
        before = block.center_of_mass() - center
        world.step(DT)
        given, turned = given + belt.impulse, turned + belt.angular_impulse
        weight_turned += np.cross(0.5 * (before + block.center_of_mass() - center), weight)
    momentum = mass * velocity_of(block)
    assert np.linalg.norm(momentum[:2]) > 0.9 * mass
    np.testing.assert_allclose(momentum + given, 60 * weight, atol=5e-3 * 60 * np.abs(weight).max())
    arms = block.positions() - center
    angular = (block.masses[:, None] * np.cross(arms, block.velocities())).sum(axis=0)
    scale = np.abs(weight_turned).max()
    np.testing.assert_allclose(angular + turned, weight_turned, atol=5e-3 * scale)
