"""Settings and fixtures for all tests."""

import gc
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from xdist.workermanage import NodeManager

from lab.extras import EXTRAS as LAB_EXTRAS
from taichi_soft import Material, box, init, load_mesh
from taichi_soft.bodies.capacity import LEAST
from taichi_soft.core.extras import EXTRAS, missing_among
from taichi_soft.core.runtime import DEBUG
from taichi_soft.world.bare import bare_world

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "shared"))  # modules that tests of several folders import

from shares import Shares  # noqa: E402
from soaks import SOAKS, changed_since, is_named, left_out, soaks_of  # noqa: E402

UNTIL = "TAICHI_SOFT_SOAKS_UNTIL"
"""Name of the environment variable with the time [s since 1970] after which no soak starts. `.ci/run` sets it
to its time limit. A slow machine omits some soaks and lists them."""

ARCH = "TAICHI_SOFT_TEST_ARCH"
"""Name of the environment variable that selects another device than the CPU: "cuda"."""

TIME_IS_UP = "a soak for which no time was left on this machine"

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")

NodeManager.EXIT_TIMEOUT = 300
"""Time limit for a worker to exit [s]. At its exit, a worker stores its compiled kernels. After a run of all
tests, this takes longer than the default limit of 10 s. The next run would find no kernels if the worker were
killed."""

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # With `&`, a shell starts the tests so that they, and the processes that they start, ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)

KINDS = ("numpy", "kernel", "world")
"""Markers for what a test runs; "world" is the default. The marker `soak` is added to slow tests."""


SINCE = "--since"
NAMED_SOAKS = {soak for soaks in SOAKS.values() for soak in soaks.split()}


def pytest_addoption(parser):
    text = "of the soaks, run those marked guard, and those that guard what changed since a git revision"
    parser.addoption(SINCE, metavar="REVISION", help=f"{text}; '' if that is not known")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    leave_out_soaks(config, items)
    files = {path: i for i, path in enumerate(dict.fromkeys(item.path for item in items))}
    items.sort(key=lambda item: (files[item.path], keeps_a_world(item)))
    for item in items:
        if not kinds_of(item) and not item.get_closest_marker("soak"):
            item.add_marker("world")
        for extra in [mark.args[0] for mark in item.iter_markers("needs")]:
            missing = missing_among({**EXTRAS, **LAB_EXTRAS}[extra])
            reason = f"needs {', '.join(missing)}: pip install -e '.[{extra}]'"
            item.add_marker(pytest.mark.skipif(bool(missing), reason=reason))


def leave_out_soaks(config, items):
    """Remove the soaks that `--since` does not select."""
    revision = config.getoption(SINCE)
    if revision is None:
        return
    try:
        changed = changed_since(revision) if revision else []
    except ValueError as error:
        raise pytest.UsageError(str(error)) from error
    left = left_out(items, HERE, soaks_of(changed))
    config.hook.pytest_deselected(items=left)
    gone = set(left)
    items[:] = [item for item in items if item not in gone]


def kinds_of(item):
    """Return the markers in `KINDS` that a test has."""
    return [kind for kind in KINDS if item.get_closest_marker(kind)]


def keeps_a_world(item):
    """True if a test may use a world that exists until the end of its file.

    These tests run last in their file. While their world exists, worlds of other tests could not reuse its
    fields, and would have to compile their kernels again.
    """
    made = item._fixtureinfo.name2fixturedefs.values()
    return any(each[-1].scope == "module" for each in made)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    kinds = kinds_of(item)
    if len(kinds) > 1:
        pytest.fail(f"{item.nodeid} is marked {' and '.join(kinds)}: leave one of them", pytrace=False)
    if not item.get_closest_marker("soak"):
        return
    if not is_named(item.path.relative_to(HERE), NAMED_SOAKS):
        pytest.fail(f"no folder in tests/shared/soaks.py names the soak {item.path.name}", pytrace=False)
    if time.time() > float(os.environ.get(UNTIL, "inf")):
        pytest.skip(TIME_IS_UP)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport():
    outcome = yield
    fail_if_skipped(outcome.get_result())


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report():
    outcome = yield
    fail_if_skipped(outcome.get_result())


def fail_if_skipped(report):
    """Report a skipped test as failed if every extra is installed, as in `.ci/run`.

    Tests that need a program that `.ci/run` could not install may be skipped. `.ci/run` names these programs.
    """
    if os.environ.get("TAICHI_SOFT_ALL_TESTS") == "1" and report.skipped and not hasattr(report, "wasxfail"):
        without = [*os.environ.get("TAICHI_SOFT_WITHOUT", "").split(), TIME_IS_UP]
        if any(package in str(report.longrepr[-1]) for package in without):
            return
        report.outcome = "failed"
        report.longrepr = f"skipped: {report.longrepr[-1]}"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    has_shares = config.getvalue("dist") == "loadscope" and config.pluginmanager.has_plugin("cacheprovider")
    return Shares(config, log) if has_shares else None


@pytest.fixture(autouse=True, scope="session")
def settle_imports():
    """Exclude the objects that imports created from later garbage collections."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def share_the_kernels():
    """Give the worlds of all tests equal capacities, so that similar worlds share compiled kernels.

    The capacities stay small if every index is checked, because spare capacity would hide a wrong index.
    """
    if os.environ.get(DEBUG) == "1":
        return
    LEAST.update(particles=2048, edges=8192, blocks=1024, triangles=4096, outer=2048, rings=2048, bodies=16)
    LEAST.update(colliders=32, samples=32768)


@pytest.fixture(autouse=True, scope="session")
def share_the_cores():
    """Limit parallel tests to one thread each, because threads of several tests would wait for each other."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        init(os.environ.get(ARCH, "cpu"), threads=1)


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
    """Return a function that makes a buffer other than a C-contiguous, writeable float32 array (n, 3)."""
    return request.param


ASSETS = HERE.parent / "assets"


@pytest.fixture(scope="session")
def thesis_mesh():
    """Mesh of the thesis's sphere, about 2 m in diameter."""
    return load_mesh(ASSETS / "sphere.npz")


@pytest.fixture(scope="session")
def cube():
    """A cube of 1 m about the origin: 27 vertices, 40 tetrahedra."""
    return box(cells=(2, 2, 2))


@pytest.fixture(scope="session")
def jelly():
    return Material(young=1e5, poisson=0.2, density=1000.0, damping=20.0, damping_ratio=0.0)


@pytest.fixture(scope="session")
def turned():
    """A rotation matrix about a skew axis, from the exponential of its generator."""
    axis = np.array([0.3, -0.5, 0.8])
    axis = axis / np.linalg.norm(axis) * 0.9
    generator = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    matrix, term = np.eye(3), np.eye(3)
    for power in range(1, 25):
        term = term @ generator / power
        matrix = matrix + term
    return matrix


@pytest.fixture
def solo():
    """Return a function that builds a world with one body and returns both.

    The world has no floor if the body is at the origin.
    """

    def build(mesh, material, world_options=None, **body_options):
        usual = {} if "position" in body_options else {"floor": None}
        world = bare_world(**{**usual, **(world_options or {})})
        body = world.add_body(mesh, material, **{"law": "virial", **body_options})
        world.build()
        return world, body

    return build


@pytest.fixture
def empty(play):
    """Return world and assets of a test file's fixture `play`, after the removal of all bodies."""
    world, kinds = play
    for body in world.bodies:
        world.despawn(body)
    return world, kinds
