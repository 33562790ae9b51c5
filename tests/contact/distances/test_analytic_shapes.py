"""Plane, sphere, box and capsule against their closed forms in NumPy float64."""

import numpy as np
import pytest

from taichi_soft import BoxShape, CapsuleShape, PlaneShape, SphereShape

NORMAL = np.array([0.6, 0.0, 0.8])
HALF = np.array([0.5, 0.2, 1.0])


def plane(x):
    return x @ NORMAL


def ball(x):
    return np.linalg.norm(x, axis=1) - 0.7


def block(x):
    """Return the distance of a box: to its nearest point from outside, to its nearest face from inside."""
    to_faces = np.abs(x) - HALF
    outside = np.linalg.norm(x - np.clip(x, -HALF, HALF), axis=1)
    return np.where((to_faces < 0).all(axis=1), to_faces.max(axis=1), outside)


def pill(x):
    nearest = np.zeros_like(x)
    nearest[:, 2] = np.clip(x[:, 2], -0.4, 0.4)
    return np.linalg.norm(x - nearest, axis=1) - 0.3


SOLIDS = {
    "plane": (PlaneShape((3, 0, 4)), plane),
    "sphere": (SphereShape(0.7), ball),
    "box": (BoxShape(2 * HALF), block),
    "capsule": (CapsuleShape(0.3, 0.8), pill),
}
pytestmark = [pytest.mark.kernel, pytest.mark.parametrize("name", SOLIDS)]


def points_near(seed, count=4000):
    """Return random points around and inside a shape, some of them far away."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.5, 1.5, (count, 3))
    x[::10] *= 10.0 ** rng.uniform(0, 4, (len(x[::10]), 1))
    return x.astype(np.float32).astype(np.float64)


def test_distances_are_exact_inside_and_outside(name, measure):
    shape, oracle = SOLIDS[name]
    x = points_near(1)
    wanted = oracle(x)
    assert (wanted < -0.05).any()
    assert (wanted > 0.05).any()
    distance, _ = measure(shape, x)
    assert (np.abs(distance - wanted) <= 5e-7 * (1 + np.abs(x).max(axis=1))).all()
    depths, inside = shape.depths(x), wanted < 0
    np.testing.assert_allclose(depths[inside], -wanted[inside], atol=1e-12 * np.abs(x).max())
    assert (depths[~inside] <= 0).all()


def test_normals_are_the_gradient(name, measure):
    """The reference is central differences of the oracle, away from its kinks."""
    shape, oracle = SOLIDS[name]
    x = points_near(2, 1000)
    x = x[np.abs(x).max(axis=1) < 1.5]
    step = 1e-5 * np.eye(3)
    gradient = np.stack([(oracle(x + e) - oracle(x - e)) / 2e-5 for e in step], axis=1)
    smooth = np.abs(np.linalg.norm(gradient, axis=1) - 1) < 1e-4
    assert smooth.mean() > 0.9
    _, normal = measure(shape, x)
    np.testing.assert_allclose(normal[smooth], gradient[smooth], atol=2e-4)


def odd_places():
    """Return points at the centre, on axes, faces, edges and corners, very near to these, and far away."""
    lattice = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3), axis=-1).reshape(-1, 3)
    x = np.concatenate([lattice * HALF, lattice * 0.7, lattice * (0, 0, 0.4), lattice * 0.3])
    tiny = [x + lattice[k] * s for k in range(27) for s in (1e-38, 1e-20, 1e-13, 1e-9, 1e-7)]
    return np.concatenate([x, *tiny, lattice * 9.9e6, 1e-30 * lattice])


def test_normals_have_unit_length_everywhere(name, measure):
    shape, oracle = SOLIDS[name]
    x = odd_places()
    distance, normal = measure(shape, x)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-6)
    rounded = x.astype(np.float32).astype(np.float64)
    np.testing.assert_allclose(distance, oracle(rounded), rtol=1e-6, atol=1e-6)


def test_a_step_along_the_normal_by_the_distance_ends_on_the_surface(name, measure):
    shape, oracle = SOLIDS[name]
    x = points_near(3)
    distance, normal = measure(shape, x)
    ends = x - distance[:, None] * normal
    assert (np.abs(oracle(ends)) <= 2e-6 * (1 + np.abs(x).max(axis=1))).all()
