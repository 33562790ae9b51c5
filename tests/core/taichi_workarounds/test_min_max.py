"""`ti.min` and `ti.max` of zeros and NaN behave as documented in `choose_by_comparison`."""

import numpy as np

from taichi_soft import init
from taichi_soft.core.runtime import ti


@ti.kernel
def choose(a: ti.types.ndarray(ndim=1), b: ti.types.ndarray(ndim=1), out: ti.types.ndarray(ndim=2)):
    for i in range(a.shape[0]):
        out[0, i] = ti.min(a[i], b[i])
        out[1, i] = ti.max(a[i], b[i])
        out[2, i] = ti.max(0.0, a[i])
        out[3, i] = ti.min(ti.Vector([a[i], b[i]]), 0.0)[0]


def test_of_two_zeros_and_of_a_number_and_nan_the_second_or_the_constant_is_taken():
    init()
    a = np.float32([0.0, -0.0, np.nan, 1.0, np.nan])
    b = np.float32([-0.0, 0.0, 1.0, np.nan, np.nan])
    found = np.zeros((4, 5), np.float32)
    choose(a, b, found)
    for rows, wanted in zip(found, [b, b, [0, 0, 0, 1, 0], [0, 0, 0, 0, 0]], strict=True):
        np.testing.assert_array_equal(rows, np.float32(wanted))
    assert np.signbit(found[:2, :2]).tolist() == [[True, False]] * 2
    assert not np.signbit(found[2:, :2]).any()
