"""The distance formulas that judge drops, compared with trimesh."""

import numpy as np
import pytest
import trimesh

from lab.drop_test import distances

pytestmark = pytest.mark.soak

POINTS = np.random.default_rng(3).uniform(-2.0, 2.0, (400, 3))
SIZE = np.array([1.0, 2.0, 0.5])
SOLIDS = {
    "ball": (distances.ball(1.1), trimesh.creation.icosphere(5, 1.1)),
    "cuboid": (distances.cuboid(SIZE), trimesh.creation.box(SIZE)),
    "capsule": (distances.capsule(0.5, 1.4), trimesh.creation.capsule(1.4, 0.5, count=(64, 64))),
    "ring": (distances.ring(1.0, 0.4), trimesh.creation.torus(1.0, 0.4, 96, 96)),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_distance_is_that_from_the_nearest_of_many_points_of_the_surface(name):
    distance, mesh = SOLIDS[name]
    surface, _ = trimesh.sample.sample_surface(mesh, 40_000, seed=1)
    nearest = np.sqrt(((POINTS[:, None] - surface[None]) ** 2).sum(axis=2).min(axis=1))
    found = distance(POINTS)
    np.testing.assert_allclose(np.abs(found), nearest, atol=0.03)
    inwards = surface - 0.02 * mesh.face_normals[_]
    assert (distance(inwards[::50]) < 0).all()
    assert (distance((surface + 0.02 * mesh.face_normals[_])[::50]) > 0).all()


def test_ground_is_cut_along_the_diagonal_of_its_cells():
    heights = np.array([[0.0, 1.0], [3.0, 0.0]])  # at (x, y) = (0, 0), (0, 1); (1, 0), (1, 1), moved to 0
    height = -distances.ground(heights, 1.0)(np.array([[0.0, 0, 0], [0.25, -0.25, 0], [-0.25, 0.25, 0]]))
    cosine = 1 / np.sqrt(1 + 9 + 9)
    np.testing.assert_allclose(height, np.array([0.0, 1.5, 0.5]) * cosine, atol=1e-12)
