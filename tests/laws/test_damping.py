"""Damping: along edges as in thesis eq. 3.9, and against the mean velocity as section 6.4 rejects it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, box, internal_forces
from tests.laws import oracle

BODY = box((1.0, 0.8, 0.6), (2, 2, 2))
RNG = np.random.default_rng(11)
B = RNG.uniform(1.0, 50.0, len(BODY.tets))
MIXED = Material(1.0e5, 0.2, 1000.0, B)


def damping_forces(x, v, model="edge"):
    with_v = internal_forces(BODY, MIXED, x, v, damping_model=model)
    return with_v - internal_forces(BODY, MIXED, x, damping_model=model)


def states(seed):
    rng = np.random.default_rng(seed)
    return BODY.vertices + rng.normal(scale=0.1, size=BODY.vertices.shape), rng.normal(
        size=BODY.vertices.shape
    )


def test_edge_damping_equals_the_equation_with_the_mean_b_of_the_sharing_tetrahedra():
    x, v = states(1)
    expected = oracle.edge_damping(BODY, B, x, v)
    np.testing.assert_allclose(damping_forces(x, v), expected, atol=1e-9 * np.abs(expected).max())


def test_mean_velocity_damping_equals_the_equation():
    x, v = states(2)
    expected = oracle.tet_mean_damping(BODY, B, v)
    np.testing.assert_allclose(damping_forces(x, v, "tet_mean"), expected, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=30, deadline=None)
@given(spin=st.tuples(*[st.floats(-10, 10)] * 3), drift=st.tuples(*[st.floats(-10, 10)] * 3))
def test_edge_damping_leaves_rigid_motion_alone(spin, drift):
    x, _ = states(3)
    v = np.cross(np.array(spin), x) + drift
    assert np.abs(damping_forces(x, v)).max() < 1e-9 * (1 + np.abs(v).max()) * B.max()


def test_mean_velocity_damping_brakes_rotation_which_is_why_the_thesis_rejects_it():
    x = BODY.vertices
    v = np.cross((0.0, 0.0, 2.0), x)
    assert np.sum(damping_forces(x, v, "tet_mean") * v) < -1.0
    assert abs(np.sum(damping_forces(x, v) * v)) < 1e-9


@pytest.mark.parametrize("model", ["edge", "tet_mean"])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_damping_never_adds_energy_nor_momentum(model, seed):
    x, v = states(seed)
    f = damping_forces(x, v, model)
    assert np.sum(f * v) < 0
    assert np.abs(f.sum(axis=0)).max() < 1e-9 * np.abs(f).max() * len(f)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_edge_damping_adds_no_angular_momentum(seed):
    x, v = states(seed)
    f = damping_forces(x, v)
    assert np.abs(np.cross(x, f).sum(axis=0)).max() < 1e-9 * np.abs(f).max() * len(f)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_an_edge_of_no_length_is_not_braked(dtype):
    x, v = states(5)
    x[1] = x[0]
    assert np.isfinite(internal_forces(BODY, MIXED, x, v, dtype=dtype)).all()
