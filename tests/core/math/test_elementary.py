"""Elementary functions compared with NumPy in higher precision."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.math.elementary import acos, atan2, cos_sin, exp, log
from taichi_soft.core.runtime import ti

pytestmark = pytest.mark.kernel

COUNT = 200_000


@ti.kernel
def run(name: ti.template(), x: ti.types.ndarray(ndim=1), y: ti.types.ndarray(ndim=1)):
    for i in range(x.shape[0]):
        if ti.static(name == "exp"):
            y[i] = exp(x[i])
        elif ti.static(name == "log"):
            y[i] = log(x[i])
        elif ti.static(name == "cos"):
            y[i] = cos_sin(x[i])[0]
        elif ti.static(name == "sin"):
            y[i] = cos_sin(x[i])[1]
        else:
            y[i] = acos(x[i])


@ti.kernel
def run_atan2(rise: ti.types.ndarray(ndim=1), way: ti.types.ndarray(ndim=1), y: ti.types.ndarray(ndim=1)):
    for i in range(rise.shape[0]):
        y[i] = atan2(rise[i], way[i])


def found(name, x):
    init()
    y = np.full_like(x, np.nan)
    run(name, x, y)
    return y


def require_within(ulps, y, wanted):
    """`wanted` has more digits than `y`, in whose last place the error is counted."""
    last_place = np.spacing(np.abs(wanted).astype(y.dtype)).astype(np.longdouble)
    assert (np.abs(y.astype(np.longdouble) - wanted) / last_place).max() <= ulps


ULPS = {np.float32: 4.0, np.float64: 4.0}


@pytest.mark.parametrize("kind", ULPS)
@pytest.mark.parametrize(
    ("name", "numpys", "low", "high"),
    [
        ("exp", np.exp, -85.0, 85.0),
        ("exp", np.exp, -1e-3, 1e-3),
        ("log", np.log, 0.1, 10.0),
        ("log", np.log, 1e-30, 1e-20),
        ("cos", np.cos, -4.0, 4.0),
        ("sin", np.sin, -4.0, 4.0),
        ("acos", np.arccos, -1.0, 1.0),
    ],
)
def test_a_function_is_exact_to_the_last_places(name, numpys, low, high, kind):
    x = np.random.default_rng(0).uniform(low, high, COUNT).astype(kind)
    require_within(ULPS[kind], found(name, x), numpys(x.astype(np.longdouble)))


@pytest.mark.parametrize("kind", ULPS)
def test_angles_are_exact_all_round(kind):
    init()
    rise, way = np.random.default_rng(1).normal(size=(2, COUNT)).astype(kind)
    y = np.full_like(rise, np.nan)
    run_atan2(rise, way, y)
    require_within(ULPS[kind], y, np.arctan2(rise.astype(np.longdouble), way.astype(np.longdouble)))


@pytest.mark.parametrize("name", ["cos", "sin"])
def test_many_turns_count_as_none(name):
    x = np.random.default_rng(2).uniform(-1e6, 1e6, COUNT).astype(np.float32)
    wanted = getattr(np, name)(x.astype(np.longdouble))
    np.testing.assert_allclose(found(name, x), wanted.astype(float), rtol=0, atol=1.2e-7)


def test_the_ends_of_each_range_are_exact():
    assert found("exp", np.float32([0.0, -1e30, -np.inf])).tolist() == [1.0, 0.0, 0.0]
    assert 1e37 < found("exp", np.float32([1e30])) < np.inf
    assert found("log", np.float32([1.0])) == 0.0
    assert found("acos", np.float32([1.0, -1.0])).tolist() == [0.0, np.float32(np.pi)]
    init()
    rise, way = np.float32([0.0, 1.0, -1.0, 0.0, -0.0, 0.0]), np.float32([0.0, 0.0, 0.0, -1.0, 2.0, 2.0])
    y = np.full_like(rise, np.nan)
    run_atan2(rise, way, y)
    half = np.pi / 2
    np.testing.assert_array_equal(y, np.float32([0.0, half, -half, np.pi, 0.0, 0.0]))
