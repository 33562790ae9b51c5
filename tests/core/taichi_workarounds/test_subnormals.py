"""Kernels compute with subnormal numbers in every thread, whatever the mode of the calling thread."""

import ctypes
import platform
import threading
from contextlib import contextmanager

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


@contextmanager
def taking_them_for_zero():
    """Set the x86 bits with which a thread treats subnormal numbers as zero, as a library may have done."""
    c, environment, before = ctypes.CDLL(None), (ctypes.c_uint32 * 8)(), (ctypes.c_uint32 * 8)()
    c.fegetenv(before)
    c.fegetenv(environment)
    environment[7] |= 0x8040  # bits of MXCSR for results and for operands
    c.fesetenv(environment)
    try:
        yield
    finally:
        c.fesetenv(before)


@pytest.mark.parametrize("kernel", [multiply_here, multiply_by_all])
def test_a_subnormal_product_is_one_in_whichever_thread_a_kernel_runs(kernel):
    found = [products(kernel)]
    other = threading.Thread(target=lambda: found.append(products(kernel)))
    other.start()
    other.join()
    for rows in found:
        np.testing.assert_array_equal(rows, SMALL * SMALLER)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="another processor has other bits")
@pytest.mark.parametrize("kernel", [multiply_here, multiply_by_all])
def test_a_caller_that_takes_subnormal_numbers_for_zero_gets_the_same_and_stays_so(kernel):
    with taking_them_for_zero():
        assert not has_subnormals()
        rows = products(kernel)
        assert not has_subnormals()
    np.testing.assert_array_equal(rows, SMALL * SMALLER)
    assert has_subnormals()
