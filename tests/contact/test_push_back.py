"""A rigid body of the game engine receives the impulses on its collider (README, "In a game loop")."""

import numpy as np
import pytest

from taichi_soft import Contact, Material, SphereShape, box
from taichi_soft.world.bare import bare_world

DT = 1 / 60
GRAVITY = np.array([0.0, 0.0, -9.81])
RADIUS = 0.2


@pytest.fixture(scope="module")
def cushion():
    """A world with a soft block of 500 kg at rest on the floor, room for a ball, and its state."""
    world = bare_world(collider_room=2)
    world.add_body(
        box((1, 1, 0.5), (4, 4, 2)),
        Material(3e5, 0.3, 1000.0, 60.0, damping_ratio=0.0),
        position=(0, 0, 0.26),
        contact=Contact(faces=False),
    )
    world.build()
    for _ in range(60):
        world.step(DT)
    return world, world.snapshot()


def drop(cushion, mass, steps):
    """A ball with a velocity of its own, pushed by what its collider reports after each step.

    Returns: the ball, its energy before each step and after the last [J], the impulses on it, (n, 3) [N s].
    """
    world, start = cushion
    world.restore(start)
    ball = world.add_collider(SphereShape(RADIUS), position=(0, 0, 1.0))
    velocity, impulse = np.array([0.0, 0.0, -3.0]), np.zeros(3)
    energy = [0.5 * mass * 9.0 + mass * 9.81 * 1.0]
    pushes = []
    for _ in range(steps):
        ball.set_velocity(velocity + DT * GRAVITY + 0.5 * impulse / mass)
        world.step(DT)
        impulse = ball.impulse
        velocity = velocity + DT * GRAVITY + impulse / mass
        pushes.append(impulse)
        energy.append(0.5 * mass * velocity @ velocity + mass * 9.81 * ball.position[2])
    return ball, np.array(energy), np.array(pushes)


@pytest.mark.parametrize(("mass", "sway"), [(500.0, 0.12), (100.0, 0.03), (20.0, 0.03)])
def test_a_rigid_ball_comes_to_rest_on_a_soft_block_and_gains_no_energy(cushion, mass, sway):
    """One as heavy as the block still sways in the second half: its mean is not yet the weight."""
    ball, energy, pushes = drop(cushion, mass, 960)
    assert energy.max() <= 1.001 * energy[0]
    assert 0.2 < ball.position[2] < 0.26 + 0.25 + RADIUS
    weight = mass * 9.81 * DT
    np.testing.assert_allclose(pushes[480:].mean(axis=0), (0, 0, weight), atol=sway * weight)


def test_a_ball_lighter_than_the_vertices_that_it_hits_is_thrown_off(cushion):
    """The limit that README names: in a step the ball is as hard to stop as any collider."""
    mass = 5.0
    soft = cushion[0].bodies[0]
    below = np.linalg.norm(soft.mesh.vertices - (0, 0, 0.25), axis=1).argmin()
    assert soft.masses[below] > mass
    _, energy, _ = drop(cushion, mass, 120)
    assert energy.max() > 4.0 * energy[0]


def test_what_was_set_can_be_read_again(cushion):
    world, start = cushion
    world.restore(start)
    surface = {"friction": 0.7, "restitution": 0.25, "thickness": 0.01, "group": 2, "mask": 5}
    ball = world.add_collider(SphereShape(RADIUS), position=(0, 0, 3.0), **surface)
    assert {name: getattr(ball, name) for name in surface} == surface
    assert world.floor_collider.restitution is None
    ball.set_velocity((1, 2, 3), (0, 0, 4))
    np.testing.assert_array_equal(ball.velocity, (1, 2, 3))
    np.testing.assert_array_equal(ball.angular_velocity, (0, 0, 4))
    body = world.bodies[0]
    assert (body.linear_damping, body.is_sheltered, body.gravity_scale) == (0.0, False, 1.0)
    body.set_linear_damping(0.5)
    body.set_sheltered(True)
    body.set_gravity_scale(0.25)
    assert (body.linear_damping, body.is_sheltered, body.gravity_scale) == (0.5, True, 0.25)
