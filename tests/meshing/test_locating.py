"""Location of points: the tetrahedron that contains a point or is nearest, compared with brute force."""

import numpy as np
import pytest

from taichi_soft.meshing import TetMesh, box, torus
from taichi_soft.meshing.locating import Locator, nearest_points

pytestmark = pytest.mark.numpy

MESHES = {"box": box((1.0, 0.6, 0.4), (4, 3, 2)), "torus": torus(1.0, 0.3)}


def spread(mesh, count, reach, seed=0):
    low, high = mesh.bounds
    return np.random.default_rng(seed).uniform(low - reach, high + reach, (count, 3))


def every_share(mesh, points):
    """Return the barycentric coordinates of each point in each tetrahedron, (k, m, 4)."""
    corners = mesh.vertices[mesh.tets]
    matrices = np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))
    rest = np.einsum("mij,kmj->kmi", matrices, points[:, None] - corners[:, 0])
    return np.concatenate([1.0 - rest.sum(axis=2, keepdims=True), rest], axis=2)


def distance_to_triangle(point, triangle):
    """Return the distance to a triangle, as a minimum over a fine grid of its points."""
    n = 60
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    keep = i + j <= n
    s, t = i[keep] / n, j[keep] / n
    places = (1 - s - t)[:, None] * triangle[0] + s[:, None] * triangle[1] + t[:, None] * triangle[2]
    return np.linalg.norm(places - point, axis=1).min()


@pytest.mark.parametrize("name", MESHES)
def test_a_point_inside_is_found_in_a_tetrahedron_that_holds_it(name):
    mesh = MESHES[name]
    points = spread(mesh, 800, 0.0)
    inside = every_share(mesh, points).min(axis=2).max(axis=1) > 1e-6
    assert inside.sum() > 100
    tet, shares = Locator(mesh)(points[inside])
    found = np.einsum("kc,kcx->kx", shares, mesh.vertices[mesh.tets[tet]])
    np.testing.assert_allclose(found, points[inside], atol=1e-9)
    assert shares.min() >= 0.0
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)


@pytest.mark.parametrize("reach", [0.2, 5.0])
@pytest.mark.parametrize("name", ["box", pytest.param("torus", marks=pytest.mark.soak)])
def test_a_point_outside_gets_the_nearest_point_of_the_mesh(name, reach):
    mesh = MESHES[name]
    points = spread(mesh, 20, reach, seed=1)
    outside = points[every_share(mesh, points).min(axis=2).max(axis=1) < -1e-6]
    tet, shares = Locator(mesh)(outside)
    found = np.einsum("kc,kcx->kx", shares, mesh.vertices[mesh.tets[tet]])
    triangles = mesh.vertices[mesh.surface]
    for point, place in zip(outside, found, strict=True):
        least = min(distance_to_triangle(point, triangle) for triangle in triangles)
        assert np.linalg.norm(place - point) <= least + 1e-9
        assert np.linalg.norm(place - point) >= least - 0.02


def test_a_walk_that_a_notch_stops_ends_where_the_point_is():
    """The mouth of a horseshoe lies between a point in one arm and a tetrahedron in the other."""
    ring = torus(1.0, 0.25)
    middle = ring.vertices[ring.tets].mean(axis=1)
    open_ring = ring.tets[~((middle[:, 0] > 0) & (np.abs(middle[:, 1]) < 0.3))]
    used, tets = np.unique(open_ring, return_inverse=True)
    mesh = TetMesh(ring.vertices[used], tets.reshape(-1, 4))
    points = mesh.vertices[mesh.tets].mean(axis=1)
    start = np.full(len(points), int(points[:, 1].argmax()))
    tet, shares = Locator(mesh)(points, start)
    np.testing.assert_array_equal(tet, np.arange(len(points)))
    np.testing.assert_allclose(shares, 0.25)


def test_the_nearest_point_of_a_triangle_may_be_inside_on_a_side_or_a_corner():
    triangle = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]])
    points = np.array([[0.5, 0.5, 3], [1, -1, 0], [2, 2, 1], [-1, -1, 0], [5, -1, 0]])
    wanted = [[0.5, 0.5, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [2, 0, 0]]
    np.testing.assert_allclose(nearest_points(points, np.tile(triangle, (5, 1, 1))), wanted, atol=1e-12)
    needle = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 0, 0]]])  # of no area
    np.testing.assert_allclose(nearest_points(np.array([[0.3, 1.0, 0]]), needle), [[0.3, 0, 0]], atol=1e-12)
