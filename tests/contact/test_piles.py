"""Piles come to rest, stay in place and fall asleep; unstable piles fall."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_soft import BoxShape, Material, box, sphere
from taichi_soft.world.bare import bare_world

DT, EDGE, COUNT = 1 / 60, 0.5, 5
DENSITY, GRAVITY = 1000.0, 9.81
BLOCK = box((EDGE,) * 3, (2, 2, 2))
COLUMN = box((EDGE, EDGE, COUNT * EDGE), (2, 2, 2 * COUNT))
FAR = 20.0  # [m]


def buckling_modulus(height, edge):
    """Young's modulus [Pa] below which a column of square section topples under its own weight.

    Greenhill 1881: the height at which it does is the cube root of 7.837 E I / (density g A).
    """
    return DENSITY * GRAVITY * height**3 / (7.837 * edge**2 / 12)


def stack(young):
    """Five blocks on each other, and far away a column in one piece of the same size and material."""
    material = Material(young, 0.3, DENSITY, 600.0 * np.sqrt(young / 5e6))
    world = bare_world(floor=0.0, gravity=(0, 0, -GRAVITY), soft_contact=True)
    for i in range(COUNT):
        world.add_body(BLOCK, material, position=(0, 0, EDGE / 2 + 1.01 * EDGE * i))
    world.add_body(COLUMN, material, position=(FAR, 0, COUNT * EDGE / 2))
    world.build()
    return world


def run(world, seconds):
    for _ in range(round(seconds / DT)):
        world.step(DT)


def leans(world):
    """How far the tops of the pile and of the column are from above their feet [m]."""
    pile, column = world.bodies[COUNT - 1], world.bodies[COUNT]
    block_top = BLOCK.vertices[:, 2] > 0.49 * EDGE
    column_top = COLUMN.vertices[:, 2] > 0.49 * COUNT * EDGE
    top = pile.positions()[block_top, :2].mean(axis=0)
    other = column.positions()[column_top, :2].mean(axis=0) - (FAR, 0.0)
    return np.linalg.norm(top), np.linalg.norm(other)


def test_a_pile_that_would_stand_in_one_piece_rests_for_a_minute():
    """A tenth stiffer than a column must be. It may creep by a hundredth of its size: it does by far less."""
    world = stack(1.1 * buckling_modulus(COUNT * EDGE, EDGE))
    run(world, 10.0)
    before = [body.positions() for body in world.bodies[:COUNT]]
    run(world, 60.0)
    for start, body in zip(before, world.bodies, strict=False):
        assert np.abs(body.positions() - start).max() < 1e-3 * EDGE
    assert max(leans(world)) < 1e-3 * EDGE


def test_a_pile_too_soft_to_stand_in_one_piece_leans_as_fast_as_that():
    """Half of the modulus of a column that stands: what leans, leans e times farther in the same time."""
    world = stack(0.5 * buckling_modulus(COUNT * EDGE, EDGE))
    times, found = [], []
    while world.time < 40.0 and (not found or min(found[-1]) < 0.1 * EDGE):
        run(world, 0.25)
        times.append(world.time)
        found.append(leans(world))
    times, found = np.array(times), np.array(found)
    rates = []
    for lean in found.T:
        grows = (lean > 2e-3) & (lean < 0.1 * EDGE)
        assert grows.sum() >= 4
        rates.append(np.polyfit(times[grows], np.log(lean[grows]), 1)[0])
    assert rates[0] == pytest.approx(rates[1], rel=0.2)
    assert rates[0] > 0.2


@pytest.mark.parametrize(
    ("heavier", "density", "young"),
    [(100, 1000.0, 1e7), pytest.param(1000, 50.0, 1e7, marks=pytest.mark.soak)],
)
def test_a_block_bears_one_of_many_times_its_mass_for_a_minute(heavier, density, young):
    """The load on the lower block is 2.5 to 5 % of Young's modulus.

    The block swings up and down, but must not creep sideways by more than 1 % of its edge in 50 s.
    """
    block, material = box((EDGE,) * 3, (3, 3, 3)), Material(young, 0.3, density)
    assert 0.02 < heavier * density * GRAVITY * EDGE / young < 0.05
    world = bare_world(gravity=(0, 0, -GRAVITY), soft_contact=True)
    lower = world.add_body(block, material, position=(0, 0, EDGE / 2))
    upper = world.add_body(block, replace(material, density=heavier * density), position=(0, 0, 1.52 * EDGE))
    world.build()
    run(world, 10.0)
    start = upper.center_of_mass()
    run(world, 50.0)
    end = upper.center_of_mass()
    assert np.linalg.norm((end - start)[:2]) < EDGE / 100
    assert np.linalg.norm(end[:2]) < EDGE / 20
    assert end[2] == pytest.approx(1.5 * EDGE, abs=0.1 * EDGE)
    for body in (lower, upper):
        assert not body.is_frozen
        assert len(body.flipped_tets()) == 0


def test_a_heap_falls_asleep_and_stays_asleep():
    """Eight balls in a pit, which lie where four walls and others let them."""
    world = bare_world(soft_contact=True, sleep_speed=0.02, collider_room=4)
    ball, material = sphere(0.25, 3), Material(5e5, 0.3, 1000.0, 100.0)
    for side in (-1, 1):
        world.add_collider(BoxShape((1, 4, 2)), position=(1.13 * side, 0, 1))
        world.add_collider(BoxShape((4, 1, 2)), position=(0, 1.13 * side, 1))
    for i in range(8):
        x, y, z = (i & 1) - 0.5, (i >> 1 & 1) - 0.5, i >> 2
        world.add_body(ball, material, position=(0.6 * x + 0.03 * z, 0.6 * y + 0.01 * z, 0.3 + 0.6 * z))
    world.build()
    while world.time < 10.0 and not all(body.is_asleep for body in world.bodies):
        world.step(DT)
    assert all(body.is_asleep for body in world.bodies)
    before = [body.positions() for body in world.bodies]
    run(world, 2.0)
    for start, body in zip(before, world.bodies, strict=True):
        assert body.is_asleep
        np.testing.assert_array_equal(body.positions(), start)
