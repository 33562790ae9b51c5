"""Distances from height fields, compared with distances from all their triangles in NumPy float64."""

import numpy as np
import pytest
from trimesh.triangles import closest_point

from taichi_soft import HeightFieldShape

pytestmark = pytest.mark.kernel

SPACING = 0.5


def ground(name):
    rng = np.random.default_rng(7)
    if name == "hills":
        i, j = np.indices((13, 9))
        return 0.3 * np.sin(0.9 * i) * np.cos(0.7 * j)
    if name == "rough":
        return rng.uniform(-0.4, 0.4, (10, 12))
    if name == "ridge":  # a single row of nodes, steep on both sides
        heights = np.zeros((11, 9))
        heights[5] = 2.0
        return heights
    return np.array([[0.0, 0.3], [0.1, -0.2]])


NAMES = ("hills", "rough", "ridge", "one cell")


@pytest.fixture(params=NAMES)
def shape(request):
    return HeightFieldShape(ground(request.param), SPACING)


def distance_to_ground(shape, x):
    """Return the distance to the nearest triangle, and the nearest point."""
    vertices, triangles = shape.surface()
    corners = vertices[triangles]
    best, place = np.full(len(x), np.inf), np.zeros_like(x)
    for corner in corners:
        near = closest_point(np.broadcast_to(corner, (len(x), 3, 3)), x)
        d = np.linalg.norm(x - near, axis=1)
        place[d < best] = near[d < best]
        best = np.minimum(best, d)
    return best, place


def height_over(shape, x):
    """Return the height of the surface, which consists of two triangles in each cell."""
    heights, low = np.asarray(shape.heights, dtype=np.float64), shape.bounds[0]
    uv = (x[:, :2] - low[:2]) / SPACING
    i, j = np.clip(np.floor(uv).astype(int), 0, np.array(heights.shape) - 2).T
    s, t = uv[:, 0] - i, uv[:, 1] - j
    a, b, c, d = heights[i, j], heights[i + 1, j], heights[i + 1, j + 1], heights[i, j + 1]
    return np.where(s >= t, a + s * (b - a) + t * (c - b), a + t * (d - a) + s * (c - d))


def points_over(shape, seed, reach=2.0, beside=0.0, count=3000):
    low, high = shape.bounds
    rng = np.random.default_rng(seed)
    low = np.array([*(low[:2] - beside), np.min(shape.heights) - reach])
    high = np.array([*(high[:2] + beside), high[2] + reach])
    return rng.uniform(low, high, (count, 3)).astype(np.float32).astype(np.float64)


def test_signs_are_exact_and_distances_never_too_large(shape, measure):
    x = points_over(shape, 1)
    above = x[:, 2] - height_over(shape, x)
    true, _ = distance_to_ground(shape, x)
    distance, normal = measure(shape, x)
    clear = np.abs(above) > 1e-5
    np.testing.assert_array_equal(np.sign(distance[clear]), np.sign(above[clear]))
    assert (np.abs(distance) <= true + 2e-6).all()
    depths = shape.depths(x)
    np.testing.assert_array_equal(np.sign(depths[clear]), -np.sign(above[clear]))
    assert (depths <= true + 2e-6).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_distances_and_normals_are_exact_within_half_a_cell(shape, measure):
    x = points_over(shape, 2, reach=0.3)
    true, place = distance_to_ground(shape, x)
    distance, normal = measure(shape, x)
    near = true < 0.5 * SPACING
    assert near.sum() > 300
    np.testing.assert_allclose(np.abs(distance[near]), true[near], atol=2e-6)
    apart = near & (true > 0.01)
    outward = np.sign(distance)[:, None] * (x - place) / np.maximum(true, 1e-9)[:, None]
    # Two triangles may be equally near: then either will do.
    fits = np.abs(normal - outward).max(axis=1) < 1e-3
    assert fits[apart].mean() > 0.999


def test_touching_points_have_the_normal_of_their_triangle(shape, measure):
    x = points_over(shape, 3)
    x[:, 2] = height_over(shape, x)
    low = shape.bounds[0]
    uv = (x[:, :2] - low[:2]) / SPACING
    off = np.abs(uv - np.round(uv)).min(axis=1)
    off = np.minimum(off, np.abs(uv[:, 0] % 1 - uv[:, 1] % 1))
    x = x[off > 0.02]
    slope = [(height_over(shape, x + e) - height_over(shape, x - e)) / 2e-4 for e in 1e-4 * np.eye(3)[:2]]
    wanted = np.stack([-slope[0], -slope[1], np.ones(len(x))], axis=1)
    wanted /= np.linalg.norm(wanted, axis=1)[:, None]
    distance, normal = measure(shape, x)
    np.testing.assert_allclose(distance, 0, atol=2e-6)
    np.testing.assert_allclose(normal, wanted, atol=1e-4)


def test_far_above_gentle_ground_steps_are_long(measure):
    """The steepest slope and the highest node limit the step, not the cell."""
    shape = HeightFieldShape(ground("hills"), SPACING)
    distance, _ = measure(shape, [[0, 0, 50.0], [0.1, 0.2, 5.0], [0, 0, -40.0]])
    assert distance[0] > 49.5
    assert distance[1] > 4.6
    assert distance[2] < -39.5


def test_beside_the_rectangle_there_is_nothing(shape, measure):
    x = points_over(shape, 4, beside=1.5)
    low, high = shape.bounds
    over = x.copy()
    over[:, :2] = np.clip(x[:, :2], low[:2], high[:2])
    away = np.linalg.norm(x - over, axis=1)
    x, over, away = x[away > 0], over[away > 0], away[away > 0]
    true, _ = distance_to_ground(shape, x)
    above = x[:, 2] > height_over(shape, over)
    distance, normal = measure(shape, x)
    assert (distance >= away - 1e-6).all()
    assert (distance[above] <= true[above] + 2e-6).all()
    assert (distance[~above] >= 0.5 * SPACING).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_odd_places_have_unit_normals_and_read_no_foreign_sample(shape, measure):
    """In this test, samples of other shapes are NaN."""
    corners = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3) * 1.0
    nodes = shape.surface()[0]
    x = np.concatenate([nodes, nodes + 1e-7, nodes - (0, 0, 1e-6), corners, 1e3 * corners, 9.9e6 * corners])
    distance, normal = measure(shape, x)
    assert np.isfinite(distance).all()
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)


def test_a_ray_that_goes_on_by_the_distance_stops_before_the_first_crossing(shape, measure):
    """A thousand rays cross the ground and the ridge. Fine sampling of each ray is the reference."""
    start, end = points_over(shape, 5, count=1000), points_over(shape, 6, count=1000)
    start[:, 2] += 2.0
    end[::2, 2] = start[::2, 2] = np.random.default_rng(8).uniform(-0.3, 1.9, 500)
    start = start[start[:, 2] > height_over(shape, start)][:700]
    end = end[: len(start)]
    length = np.linalg.norm(end - start, axis=1)
    gone = np.zeros(len(start))
    for _ in range(150):
        x = start + (gone / length)[:, None] * (end - start)
        distance, _ = measure(shape, x)
        gone = np.minimum(gone + np.maximum(distance, 0), length)
    first = length.copy()
    for t in np.linspace(1, 0, 600):
        x = start + t * (end - start)
        under = x[:, 2] < height_over(shape, x) - 1e-5
        first[under] = t * length[under]
    hits = first < length
    assert hits.sum() > 20
    assert (gone <= first + 1e-5 + length / 599).all()
    # The distances approach the ground, so the bound is not simply zero.
    assert np.median((first - gone)[hits]) < 0.02 * SPACING
