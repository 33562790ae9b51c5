"""Impacts faster than sound: a step that fails is retried with smaller substeps."""

import numpy as np
import pytest

from taichi_soft import BoxShape, Material, PlaneShape, box
from taichi_soft.core.math.rotations import matrix_of
from taichi_soft.world.bare import bare_world

DT, SPEED = 1 / 60, 47.0
FOAM = Material(young=4e4, poisson=0.4, density=213.0, damping=6.0)  # sound: 14 m/s
POSES = np.random.default_rng(3).normal(size=(6, 4))


def thrown():
    """Six cubes, each on its way to a floor and a wall of its own."""
    world = bare_world(floor=None, gravity=(0, 0, 0), collider_room=2)
    world.add_collider(PlaneShape())
    world.add_collider(BoxShape((0.2, 40, 40)), position=(1.0, 0, 0))
    for number, pose in enumerate(POSES):
        rotation = matrix_of(pose / np.linalg.norm(pose))
        place, velocity = (0, 2.0 * number, 0.6), (0.3 * SPEED, 0, -0.95 * SPEED)
        world.add_body(box((0.3,) * 3, (3, 3, 3)), FOAM, position=place, rotation=rotation, velocity=velocity)
    world.build()
    return world


@pytest.fixture(scope="module")
def flights():
    """Return a world after the impact, restored during the impact from a snapshot of an earlier world.

    Also return the final hash of the earlier world, the momentum before, and the impulse on the colliders.
    """
    first = thrown()
    before = np.sum([body.momentum() for body in first.bodies], axis=0)
    taken = np.zeros(3)
    for step in range(8):
        first.step(DT)
        if step == 0:
            data = first.snapshot()
        taken += np.sum([collider.impulse for collider in first.colliders], axis=0)
    name = first.state_hash()
    del first  # the next one takes over its kernels
    second = thrown()
    second.restore(data)
    for _ in range(7):
        second.step(DT)
    return second, name, before, taken


def test_no_body_breaks(flights):
    for body in flights[0].bodies:
        assert not body.is_frozen
        assert np.isfinite(body.positions()).all()
        assert np.linalg.norm(body.momentum()) < SPEED * body.masses.sum()


def test_colliders_are_told_what_the_step_gave_that_counts(flights):
    world, _, before, taken = flights
    after = np.sum([body.momentum() for body in world.bodies], axis=0)
    np.testing.assert_allclose(taken, before - after, atol=1e-5 * np.linalg.norm(before))


def test_it_goes_the_same_way_again(flights):
    second, name, _, _ = flights
    assert second.state_hash() == name
