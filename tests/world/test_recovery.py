"""A body of recovering tetrahedra comes back from anything."""

import numpy as np
import pytest

from taichi_soft import Material, TetMesh, World, internal_forces, sphere

BALL = sphere(1.0, 2)
RNG = np.random.default_rng(4)
WRECKS = {
    "scrambled": RNG.uniform(-1, 1, BALL.vertices.shape),
    "flattened": BALL.vertices * (1, 1, 0),
    "turned inside out": -BALL.vertices,
    "shrunk to a point": BALL.vertices * 1e-3,
    "drawn into a line": BALL.vertices * (1, 0, 0),
}


@pytest.mark.parametrize("strain", ["linear", "exact"])
@pytest.mark.parametrize("poisson", [0.2, 0.45])
@pytest.mark.parametrize("wreck", WRECKS)
def test_a_wrecked_body_finds_its_shape_again(strain, poisson, wreck):
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(BALL, Material(1e5, poisson, 1000, 200), strain=strain, flips="recover")
    world.build()
    start = WRECKS[wreck] + RNG.normal(scale=1e-3, size=BALL.vertices.shape)
    body.set_motion(start, np.zeros_like(start))
    for _ in range(600):
        world.step(1 / 60, 8)
    assert not body.is_frozen
    assert body.flipped_count() == 0
    corners = body.positions().astype(float)[BALL.edges]
    lengths = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    np.testing.assert_allclose(lengths, BALL.edge_lengths, rtol=0.01)


def volume_rate(x, v):
    """Six times how fast the volume of a tetrahedron grows [m^3/s], and the gradient of that volume."""
    a, b, c = x[1:] - x[0]
    gradient = np.array([np.zeros(3), np.cross(b, c), np.cross(c, a), np.cross(a, b)])
    gradient[0] = -gradient.sum(axis=0)
    return np.sum(gradient * v), gradient


def braked(x, v, share):
    """Velocities after that share of the speed at which the volume falls is gone."""
    rate, gradient = volume_rate(x, v)
    return v - share * min(rate, 0.0) / np.sum(gradient**2) * gradient


def test_a_flipped_tetrahedron_loses_a_tenth_of_the_speed_at_which_its_volume_falls_in_every_substep():
    """Undamped, against leapfrog in NumPy with the brake, and without it."""
    corners = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1.2, 0], [0.1, 0.2, 0.8]])
    mesh = TetMesh(corners, np.array([[0, 1, 2, 3]]))
    material = Material(1e4, 0.3, 1000.0)
    x = corners * (1, 1.1, -0.9)
    v = -volume_rate(x, x)[1] + np.random.default_rng(0).normal(size=(4, 3))
    assert volume_rate(x, v)[0] < 0
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(mesh, material, flips="recover")
    world.build()
    body.set_motion(x, v)
    h, mass = 1e-3, 1000.0 * mesh.volumes[0] / 4
    free_x, free_v, kick = x.copy(), v.copy(), h / 2
    for _ in range(30):
        world.step(h, 1)
        for at, speed, share in ((x, v, 0.1), (free_x, free_v, 0.0)):
            assert np.linalg.det(at[1:] - at[0]) < 0
            force = internal_forces(mesh, material, at, flips="recover")
            speed[:] = braked(at, speed, share) + force / mass * kick
            at += speed * h
        kick = h
    assert np.abs(free_x - x).max() > 1e-2
    np.testing.assert_allclose(body.positions(), x, atol=1e-5)


def test_a_flipped_tetrahedron_on_its_way_back_is_not_braked():
    """Mirrored and shrinking: leapfrog in NumPy without any brake."""
    corners = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1.2, 0], [0.1, 0.2, 0.8]])
    mesh = TetMesh(corners, np.array([[0, 1, 2, 3]]))
    material = Material(1e4, 0.3, 1000.0)
    x = (corners - corners.mean(axis=0)) * (1.4, 1.3, -1.1)
    v = -x
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(mesh, material, flips="recover")
    world.build()
    body.set_motion(x, v)
    h, mass, kick = 1e-4, 1000.0 * mesh.volumes[0] / 4, 5e-5
    for _ in range(30):
        np.testing.assert_array_equal(braked(x, v, 0.1), v)
        world.step(h, 1)
        v += internal_forces(mesh, material, x, flips="recover") / mass * kick
        x += v * h
        kick = h
    np.testing.assert_allclose(body.positions(), x, atol=1e-6)


def test_the_brake_of_flipped_tetrahedra_keeps_momentum_and_angular_momentum():
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(BALL, Material(1e5, 0.2, 1000, 200), flips="recover")
    world.build()
    start = WRECKS["scrambled"]
    speeds = np.random.default_rng(2).normal(size=start.shape)
    body.set_motion(start, speeds)
    mass = body.masses.astype(float)[:, None]
    size = np.sum(mass * np.linalg.norm(speeds, axis=1, keepdims=True))
    for _ in range(4):
        world.step(1 / 480, 1)
    assert body.flipped_count() > 0
    x, v = body.positions().astype(float), body.velocities().astype(float)
    np.testing.assert_allclose(np.sum(mass * v, axis=0), np.sum(mass * speeds, axis=0), atol=1e-5 * size)
    before, after = np.sum(mass * np.cross(start, speeds), axis=0), np.sum(mass * np.cross(x, v), axis=0)
    np.testing.assert_allclose(after, before, atol=1e-5 * size)
