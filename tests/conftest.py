"""For all tests: repeatable property tests, and buffers that fit nowhere."""

import gc
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

from taichi_soft import init

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")

sys.path.insert(0, str(Path(__file__).parent / "shared"))  # what tests of several folders import

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that runs the tests behind `&` has them ignore Ctrl-C, and the processes that they start too.
    signal.signal(signal.SIGINT, signal.default_int_handler)

TOGETHER = (
    *("tests/experiments/", "tests/integrators/", "tests/laws/", "tests/demos/"),
    *("tests/world/test_cut", "tests/world/test_control"),
)
"""Files that begin alike share most of their kernels, which one worker compiles for all of them; experiments
share what they measure, too."""

RANDOM_GAMES = ("world/test_threads", "world/test_snapshot", "world/test_recorder", "world/test_rollback")
"""Files with the same game: the same again."""

LONGEST = (
    *("world/test_threads", "cli/test_cli", "world/test_implicit_contact", "world/test_joints"),
    *("world/test_plasticity", "world/test_bodies", "world/test_colliders", "world/test_states"),
    *("world/test_particle_bodies", "profiling/test_profiling", "drops/test_drops", "test_readme"),
)
"""Files that take longest where nothing is compiled yet. They begin first, so that no worker ends alone."""


class ByKernels(LoadFileScheduling):
    """Whole files to one worker, and those that share their kernels to the same one."""

    def _split_scope(self, nodeid):
        file = super()._split_scope(nodeid)
        if file in {f"tests/{name}.py" for name in RANDOM_GAMES}:
            return "random games"
        return next((start for start in TOGETHER if file.startswith(start)), file)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    return ByKernels(config, log) if config.getvalue("dist") == "loadfile" else None


def pytest_collection_modifyitems(items):
    first = [*TOGETHER, *(f"tests/{name}.py" for name in LONGEST)]

    def place(item):
        return next((n for n, start in enumerate(first) if item.nodeid.startswith(start)), len(first))

    items.sort(key=place)


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
