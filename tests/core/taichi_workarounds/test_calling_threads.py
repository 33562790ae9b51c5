"""Taichi used by several threads at once, and fields that a caller creates."""

import sys
import threading

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.runtime import ti

KERNELS, TERMS = 30, 50


def make_kernel(k):
    """A kernel that has not been compiled yet, whose source takes a while to walk through."""

    @ti.kernel
    def fill(out: ti.types.ndarray(dtype=ti.i32, ndim=1)):
        for i in range(out.shape[0]):
            for _ in ti.static(range(TERMS)):
                out[i] = out[i] + i + k

    return fill


@pytest.fixture
def alternating():
    """Threads alternate within the compilation of a kernel."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(usual)


@pytest.mark.usefixtures("alternating")
def test_a_thread_writes_and_reads_fields_while_another_one_compiles():
    init()
    fields = [ti.field(ti.i32, 4) for _ in range(KERNELS)]  # each compiles kernels too when it is first used
    found, wanted = [], [[TERMS * (i + k) for i in range(4)] for k in range(KERNELS)]

    def compile_kernels():
        for k in range(KERNELS):
            out = np.zeros(4, np.int32)
            make_kernel(k)(out)
            found.append(out.tolist())

    compiling = threading.Thread(target=compile_kernels)
    compiling.start()
    for k, field in enumerate(fields):
        field[1] = k
        assert field[1] == k
        assert field.to_numpy().tolist() == [0, k, 0, 0]
    compiling.join()
    assert found == wanted
