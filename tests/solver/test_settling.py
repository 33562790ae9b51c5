"""Slow piles come to rest, and what moves freely goes on: in one world, with and without sleep."""

import numpy as np
import pytest

from taichi_soft import BoxShape, Contact, Material, ShellMaterial, World, box, sheet, sphere

DT, GRAVITY, SLEEP = 1 / 60, 9.81, 0.02
FIRM = Material(young=5e6, poisson=0.4, density=500.0)
ELASTIC = Material(young=2e6, poisson=0.3, density=500.0, damping_ratio=0.01)
CUBE = box((0.2, 0.2, 0.2), (2, 2, 2))
FRICTION, SLOPE, START = 0.5, np.radians(28.5), 6.0  # of the slope: friction, angle, place along y [m]
DOWN = np.array((np.cos(SLOPE), 0.0, -np.sin(SLOPE)))
COLUMN, SLIDER, ROLLER, ROLLER_BESIDE, BAR, BAR_BESIDE, FLOATING = range(10), 10, 11, 12, 14, 15, (17, 18)
SECONDS = 3.0


def on_slope(along, above):
    return tuple(along * DOWN + above * np.array((np.sin(SLOPE), 0.0, np.cos(SLOPE))) + (0.0, START, 3.0))


def build(sleep_speed):
    """Make a column, a block on a slope, a ball, a ball beside a block, a bar, a bar above a block, and two
    blocks in the air."""
    world = World(floor=0.0, sleep_speed=sleep_speed)
    lean = (0.0, np.sin(SLOPE / 2), 0.0, np.cos(SLOPE / 2))
    world.add_collider(BoxShape((8, 1, 1)), position=on_slope(0, -0.5), rotation=lean, friction=FRICTION)
    for i in range(10):
        world.add_body(CUBE, FIRM, position=(0, 0, 0.1 + 0.202 * i))
    world.add_body(CUBE, FIRM, position=on_slope(-1.0, 0.1001), rotation=lean)
    ball = sphere(radius=0.1, resolution=4)
    for y in (-4.0, -8.0):
        world.add_body(ball, ELASTIC, position=(0, y, 0.1))
    world.add_body(CUBE, FIRM, position=(0.5, -8.23, 0.1))
    bar = box((0.1, 0.1, 1.0), (1, 1, 8))
    top = np.flatnonzero(bar.vertices[:, 2] > 0.49)
    for y in (-12.0, -16.0):
        world.add_body(bar, Material(1e6, 0.3, 1000.0, damping_ratio=0.01), position=(0, y, 0.72), pinned=top)
    world.add_body(CUBE, FIRM, position=(0, -16.0, 0.1))
    for x in (-0.106, 0.106):
        world.add_body(CUBE, FIRM, position=(x, 2.5, 1.0), velocity=(-0.15 * x, 0.02, 0.03))
    world.build()
    for each in FLOATING:
        world.bodies[each].set_gravity_scale(0.0)
    swing = 0.08 * (0.5 - bar.vertices[:, 2:]) ** 2 * (1.0, 0.0, 0.0)
    for each in (BAR, BAR_BESIDE):
        world.bodies[each].set_motion(world.bodies[each].positions(), swing)
    rolling = np.array((0.6, 0.0, 0.0)) + np.cross((0.0, 6.0, 0.0), ball.vertices)
    for each in (ROLLER, ROLLER_BESIDE):
        world.bodies[each].set_motion(world.bodies[each].positions(), rolling)
    return world


def totals(bodies):
    """Momentum of bodies, and angular momentum about their common centre."""
    m = np.concatenate([body.masses for body in bodies]).astype(float)
    x = np.concatenate([body.positions() for body in bodies]).astype(float)
    v = np.concatenate([body.velocities() for body in bodies]).astype(float)
    center = m @ x / m.sum()
    return m @ v, m @ np.cross(x - center, v)


@pytest.fixture(scope="module")
def runs():
    """Centres of the bodies after each step, times at which they fell asleep, and momenta in the air before
    and after 0.5 s."""
    found = []
    for sleep_speed in (SLEEP, 0.0):
        world = build(sleep_speed)
        centers, asleep = [], np.full(len(world.bodies), np.inf)
        floating = [world.bodies[each] for each in FLOATING]
        before = totals(floating)
        for step in range(round(SECONDS / DT)):
            world.step(DT)
            centers.append([body.center_of_mass() for body in world.bodies])
            for i, body in enumerate(world.bodies):
                asleep[i] = min(asleep[i], (step + 1) * DT) if body.is_asleep else np.inf
            if step == 29:
                after = totals(floating)
        found.append((np.array(centers), asleep, before, after))
    return found


def test_a_column_that_sways_up_and_down_falls_asleep_within_two_seconds(runs):
    """Its cubes move as a whole and hardly deform, so that their material does not stop them."""
    (_, asleep, *_), (free, *_) = runs
    assert asleep[list(COLUMN)].max() < 2.0
    speeds = np.abs(np.diff(free[:, 9, 2])) / DT
    assert speeds[-10:].max() > SLEEP  # without sleep


def test_a_block_slides_down_a_slope_steeper_than_its_friction_from_rest(runs):
    """The tangent of the slope is 1.09 times its friction."""
    (centers, asleep, *_), _ = runs
    assert np.isinf(asleep[SLIDER])
    along = centers[:, SLIDER] @ DOWN
    acceleration = GRAVITY * (np.sin(SLOPE) - FRICTION * np.cos(SLOPE))
    speed = (along[-1] - along[-31]) / (30 * DT)
    assert speed == pytest.approx(acceleration * (SECONDS - 15 * DT), rel=0.2)


def test_a_ball_rolls_on_as_without_sleep_also_past_a_block(runs):
    (centers, *_), (free, *_) = runs
    for ball in (ROLLER, ROLLER_BESIDE):
        rolled, expected = centers[-1, ball, 0], free[-1, ball, 0]
        assert expected > 1.0
        assert rolled == pytest.approx(expected, rel=0.02)


def test_a_pendulum_above_a_block_at_rest_swings_as_one_that_is_alone(runs):
    (centers, asleep, *_), _ = runs
    assert np.isinf(asleep[[BAR, BAR_BESIDE]]).all()
    alone, beside = (centers[:, each, 0] for each in (BAR, BAR_BESIDE))
    np.testing.assert_allclose(beside, alone, atol=0.01 * np.abs(alone).max())


def test_two_slow_bodies_that_touch_in_the_air_keep_momentum_and_angular_momentum(runs):
    (centers, asleep, before, after), _ = runs
    gap = centers[:, FLOATING[1], 0] - centers[:, FLOATING[0], 0]
    assert gap[:30].min() < 0.205 < gap[0]  # they touched
    assert np.isinf(asleep[list(FLOATING)]).all()
    size = np.linalg.norm(before[0])
    np.testing.assert_allclose(after[0], before[0], atol=1e-6 * size)
    np.testing.assert_allclose(after[1], before[1], atol=1e-6 * size)  # per metre


def test_a_cloth_whose_folds_still_tremble_in_contact_falls_asleep():
    """Its vertices are faster than the sleep speed for moments, but they do not move away."""
    world = World(floor=0.0, sleep_speed=SLEEP)
    world.add_collider(BoxShape((0.4, 0.4, 0.2)), position=(0, 0, 0.1))
    linen = ShellMaterial(5e6, 0.3, 500, 5e-4, damping=0.02, bending_damping=0.01)
    cloth = world.add_body(
        sheet((0.6, 0.6), (12, 12)),
        linen,
        position=(0.03, 0.02, 0.23),
        contact=Contact(itself=True, thickness=5e-3),
    )
    world.build()
    seconds = 0.0
    while not cloth.is_asleep and seconds < 10.0:
        world.step(DT)
        seconds += DT
    assert cloth.is_asleep
