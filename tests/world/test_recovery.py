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
}


@pytest.mark.parametrize("strain", ["linear", "exact"])
@pytest.mark.parametrize("wreck", WRECKS)
def test_a_wrecked_body_finds_its_shape_again(strain, wreck):
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(BALL, Material(1e5, 0.2, 1000, 200), strain=strain, flips="recover")
    world.build()
    start = WRECKS[wreck] + RNG.normal(scale=1e-3, size=BALL.vertices.shape)
    body.set_motion(start, np.zeros_like(start))
    for _ in range(900):
        world.step(1 / 60, 8)
    assert not body.is_frozen
    assert body.flipped_count() == 0
    corners = body.positions().astype(float)[BALL.edges]
    lengths = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    np.testing.assert_allclose(lengths, BALL.edge_lengths, rtol=0.01)


def braked(mesh, x, v, b):
    """Thesis eq. 3.9 on the six edges of a single tetrahedron."""
    forces = np.zeros((4, 3))
    for p in range(4):
        for q in set(range(4)) - {p}:
            n = (x[q] - x[p]) / np.linalg.norm(x[q] - x[p])
            forces[p] += b * n.dot(v[q] - v[p]) * n
    return forces


def test_a_flipped_tetrahedron_is_braked_by_a_share_of_what_a_substep_bears():
    """0.015 of m / h, m being the mass of its lightest vertex; not in the first substep, where h is not known."""
    corners = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1.2, 0], [0.1, 0.2, 0.8]])
    mesh = TetMesh(corners, np.array([[0, 1, 2, 3]]))
    material = Material(1e4, 0.3, 1000.0)
    rng = np.random.default_rng(0)
    x, v = corners * (1, 1, -1), rng.normal(size=(4, 3))
    world = World(gravity=(0, 0, 0), floor=None)
    body = world.add_body(mesh, material, flips="recover")
    world.build()
    body.set_motion(x, v)
    h, lag, mass = 1e-3, 0.0, 1000.0 * mesh.volumes[0] / 4
    free_x, free_v = x.copy(), v.copy()
    for _ in range(30):
        world.step(h, 1)
        for at, speed, brake in ((x, v, 0.015), (free_x, free_v, 0.0)):
            assert np.linalg.det(at[1:] - at[0]) < 0
            force = internal_forces(mesh, material, at, flips="recover")
            force += braked(mesh, at, speed, brake * mass / lag if lag else 0.0)
            speed += force / mass * (lag + h) / 2
            at += speed * h
        lag = h
    ways = np.abs(free_x - x).max()
    assert ways > 1e-3  # what the brake does is seen
    np.testing.assert_allclose(body.positions(), x, atol=0.005 * ways)
