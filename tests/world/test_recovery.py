"""A body of recovering tetrahedra comes back from anything."""

import numpy as np
import pytest

from taichi_soft import Material, World, sphere

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
