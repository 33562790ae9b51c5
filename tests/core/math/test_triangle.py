"""Geometry of one triangle against linear systems solved in float64."""

import numpy as np
import pytest
from scipy.optimize import linprog

from taichi_soft import box
from taichi_soft.core.math.triangle import closest_point_on_triangle, solid_angle, triangle_touches_box
from taichi_soft.core.runtime import init, ti

pytestmark = pytest.mark.kernel


@ti.kernel
def run_closest(points: ti.types.ndarray(ndim=3), weights: ti.types.ndarray(ndim=2)):
    ti.loop_config(serialize=True)
    for i in range(points.shape[0]):
        x, a, b, c = [ti.Vector([points[i, j, k] for k in range(3)]) for j in ti.static(range(4))]
        w = closest_point_on_triangle(x, a, b, c)
        for k in ti.static(range(3)):
            weights[i, k] = w[k]


def closest_weights(points):
    init()
    weights = np.full((len(points), 3), np.nan, dtype=points.dtype)
    run_closest(points, weights)
    return weights.astype(float)


def nearest_on_segment(x, a, b):
    length = (b - a) @ (b - a)
    t = 0.0 if length == 0 else min(max((x - a) @ (b - a) / length, 0), 1)
    return np.linalg.norm(x - (1 - t) * a - t * b)


def nearest_distance(x, a, b, c):
    """Least squares in the plane if the foot falls inside, otherwise the nearest of the three segments."""
    foot, _, rank, _ = np.linalg.lstsq(np.array([b - a, c - a]).T, x - a, rcond=1e-9)
    if rank == 2 and foot.min() >= 0 and foot.sum() <= 1:
        return np.linalg.norm(a + foot[0] * (b - a) + foot[1] * (c - a) - x)
    return min(nearest_on_segment(x, *ends) for ends in ((a, b), (b, c), (c, a)))


def reached(points, weights):
    """Distance of each x from the point that the weights name."""
    corners = points[:, 1:].astype(float)
    return np.linalg.norm(np.einsum("ij,ijk->ik", weights, corners) - points[:, 0].astype(float), axis=1)


def cases(kind, count=400):
    """A point and a triangle in each row, (count, 4, 3)."""
    random = np.random.default_rng(1)
    rows = random.normal(size=(count, 4, 3))
    if kind == "slivers":
        rows[:, 3] = 0.5 * (rows[:, 1] + rows[:, 2]) + 1e-6 * rows[:, 3]
    elif kind == "segments":
        rows[:, 3] = rows[:, 1] + random.uniform(-2, 3, (count, 1)) * (rows[:, 2] - rows[:, 1])
    elif kind == "needles":
        rows[:, 3] = rows[:, 2]
    elif kind == "points":
        rows[:, 2:] = rows[:, 1:2]
    elif kind == "small":
        rows[:, 1:] *= 1e-5
    elif kind == "far":
        rows[:, 0] *= 1e4
    elif kind == "on the triangle":
        weights = random.dirichlet((1, 1, 1), count)
        rows[:, 0] = np.einsum("ij,ijk->ik", weights, rows[:, 1:])
    elif kind == "at a corner":
        rows[:, 0] = rows[np.arange(count), 1 + np.arange(count) % 3]
    return rows


@pytest.mark.parametrize(("dtype", "precision"), [(np.float32, 3e-7), (np.float64, 1e-14)])
@pytest.mark.parametrize(
    "kind",
    ["any", "slivers", "segments", "needles", "points", "small", "far", "on the triangle", "at a corner"],
)
def test_no_point_of_the_triangle_is_nearer(kind, dtype, precision):
    points = cases(kind).astype(dtype)
    weights = closest_weights(points)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=4 * precision)
    expected = np.array([nearest_distance(*row) for row in points.astype(float)])
    np.testing.assert_allclose(reached(points, weights), expected, atol=precision * np.abs(points).max())


@pytest.mark.parametrize("shift", [0.0, 1e-9, 1e5, 1e7])
def test_a_triangle_of_no_size_is_its_corner(shift):
    """The sizes include lengths whose squares exceed the range of float32."""
    points = np.full((3, 4, 3), shift, dtype=np.float32)
    points[1, 0] += 1e7
    points[2, 1] += 1e-22
    weights = closest_weights(points)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1)


@ti.kernel
def run_solid_angle(corners: ti.types.ndarray(ndim=3)) -> ti.f32:
    total = 0.0
    ti.loop_config(serialize=True)
    for i in range(corners.shape[0]):
        a, b, c = [ti.Vector([corners[i, j, k] for k in range(3)]) for j in ti.static(range(3))]
        total += solid_angle(a, b, c)
    return total


@pytest.mark.parametrize(("shift", "turns"), [((0, 0, 0), 1), ((0.4, -0.4, 0.3), 1), ((2, 0, 0.1), 0)])
def test_a_closed_surface_fills_the_view_from_inside_and_none_of_it_from_outside(shift, turns):
    """A cube's face alone fills a sixth from the middle; turned inside out it counts the other way."""
    init()
    mesh = box(cells=(2, 2, 2))
    corners = (mesh.vertices + np.array(shift))[mesh.surface].astype(np.float32)
    assert run_solid_angle(corners) == pytest.approx(turns * 4 * np.pi, abs=1e-5)
    assert run_solid_angle(corners[:, ::-1].copy()) == pytest.approx(-turns * 4 * np.pi, abs=1e-5)
    if shift == (0, 0, 0):
        top = corners[(corners[:, :, 2] == 0.5).all(axis=1)]
        assert run_solid_angle(top) == pytest.approx(4 * np.pi / 6, abs=1e-5)


@ti.kernel
def run_touches_box(
    corners: ti.types.ndarray(ndim=3), half: ti.types.ndarray(ndim=1), found: ti.types.ndarray()
):
    ti.loop_config(serialize=True)
    for i in range(corners.shape[0]):
        a, b, c = [ti.Vector([corners[i, j, k] for k in range(3)]) for j in ti.static(range(3))]
        found[i] = int(triangle_touches_box(a, b, c, ti.Vector([half[0], half[1], half[2]])))


def depth_in_box(corners, half):
    """How deep a triangle's best point lies in the box, negative outside: a linear program of its weights."""
    above = np.concatenate([corners, -corners], axis=1).T  # (6, 3) on the weights
    rows = np.concatenate([above, np.ones((6, 1))], axis=1)
    result = linprog(
        [0, 0, 0, -1], rows, np.tile(half, 2), [[1, 1, 1, 0]], [1], [(0, 1)] * 3 + [(None, None)]
    )
    return -result.fun


def test_a_triangle_touches_a_box_where_a_mixture_of_its_corners_lies_in_it():
    """Large triangles that pass by faces, edges and corners, and flat ones."""
    init()
    random = np.random.default_rng(9)
    corners = random.normal(0, 1.0, (400, 3, 3))
    corners[::4] += 0.7 * random.normal(size=(100, 1, 3))
    corners[1::8, 2] = corners[1::8, 1]
    corners[3::8, 2] = 2 * corners[3::8, 1] - corners[3::8, 0]
    corners, half = corners.astype(np.float32), np.array([0.5, 0.25, 0.4], dtype=np.float32)
    found = np.zeros(len(corners), dtype=np.int32)
    run_touches_box(corners, half, found)
    depths = np.array([depth_in_box(rows.astype(float), half) for rows in corners])
    clear = np.abs(depths) > 1e-6
    np.testing.assert_array_equal(found[clear] == 1, depths[clear] > 0)
    assert 50 < (depths > 0).sum() < 350
