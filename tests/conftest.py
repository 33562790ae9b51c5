"""For all tests: repeatable property tests, and buffers that fit nowhere."""

import gc
import os

import numpy as np
import pytest
from hypothesis import settings

from taichi_soft import init

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")


@pytest.fixture(autouse=True, scope="session")
def settle_imports():
    """What the imports made stays: the collector need not walk it after every test."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def share_the_cores():
    """Tests that run side by side take a core each: threads would wait for those of others."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        init("cpu", threads=1)


def _read_only(n):
    rows = np.zeros((n, 3), dtype=np.float32)
    rows.flags.writeable = False
    return rows


@pytest.fixture(
    params=[
        lambda n: np.zeros((n, 3)),
        lambda n: np.zeros((n, 3), dtype=np.int32),
        lambda n: np.zeros((n, 3), dtype=">f4"),
        lambda n: np.zeros((n - 1, 3), dtype=np.float32),
        lambda n: np.zeros((n, 4), dtype=np.float32),
        lambda n: np.zeros(3 * n, dtype=np.float32),
        lambda n: np.zeros((1, n, 3), dtype=np.float32),
        lambda n: np.zeros((3, n), dtype=np.float32).T,
        lambda n: np.zeros((2 * n, 3), dtype=np.float32)[::2],
        lambda n: np.zeros((n, 4), dtype=np.float32)[:, :3],
        _read_only,
        lambda n: [[0.0] * 3] * n,
        lambda n: memoryview(bytearray(12 * n)),
    ]
)
def unfit_buffer(request):
    """Makes what is no C-contiguous, writeable float32 array of shape (n, 3)."""
    return request.param
