"""Kernels take subnormal numbers for zero in every thread; nobody else does."""

import threading

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.runtime import ti

ROWS = 4096
SMALL, SMALLER = np.float32(1e-30), np.float32(1e-10)  # their product is subnormal: under 1.2e-38


@ti.kernel
def multiply_here(a: ti.types.ndarray(ndim=1), b: ti.f32, out: ti.types.ndarray(ndim=1)):
    ti.loop_config(serialize=True)
    for i in range(a.shape[0]):
        out[i] = a[i] * b


@ti.kernel
def multiply_by_all(a: ti.types.ndarray(ndim=1), b: ti.f32, out: ti.types.ndarray(ndim=1)):
    ti.loop_config(block_dim=16)
    for i in range(a.shape[0]):
        out[i] = a[i] * b


def products(kernel):
    init()
    found = np.ones(ROWS, np.float32)
    kernel(np.full(ROWS, SMALL), SMALLER, found)
    return found


def has_subnormals():
    return bool(np.all(np.full(16, SMALL) * SMALLER > 0.0))


@pytest.mark.parametrize("kernel", [multiply_here, multiply_by_all])
def test_a_subnormal_product_is_zero_in_whichever_thread_a_kernel_runs(kernel):
    found = [products(kernel)]
    other = threading.Thread(target=lambda: found.append(products(kernel)))
    other.start()
    other.join()
    assert [np.count_nonzero(rows) for rows in found] == [0, 0]


def test_subnormal_numbers_of_the_caller_are_as_they_were_after_kernels():
    products(multiply_here)
    assert has_subnormals()
