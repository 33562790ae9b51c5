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

from taichi_soft import Material, World, box, init, load_mesh
from taichi_soft.bodies.capacity import LEAST
from taichi_soft.core.runtime import DEBUG

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")

sys.path.insert(0, str(Path(__file__).parent / "shared"))  # what tests of several folders import

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that runs the tests behind `&` has them ignore Ctrl-C, and the processes that they start too.
    signal.signal(signal.SIGINT, signal.default_int_handler)

TOGETHER = (
    *("tests/lab/experiments/", "tests/solver/integrators/", "tests/elements/laws/", "tests/demos/"),
    *("tests/fracture/test_cut", "tests/control/"),
)
"""Files that begin alike share most of their kernels, which one worker compiles for all of them; experiments
share what they measure, too."""

RANDOM_GAMES = (
    *("solver/test_threads", "persistence/test_snapshot"),
    *("persistence/test_recorder", "persistence/test_rollback"),
)
"""Files with the same game: the same again."""

LONGEST = (
    *("solver/test_threads", "cli/test_cli", "contact/test_implicit_contact", "control/test_joints"),
    *("solver/test_plasticity", "world/test_bodies", "contact/test_colliders", "bodies/test_states"),
    *(
        "bodies/test_particle_bodies",
        "lab/profiling/test_profiling",
        "lab/drop_test/test_drops",
        "test_readme",
    ),
)
"""Files that take longest where nothing is compiled yet. They begin first, so that no worker ends alone."""


NUMPY = ("meshing/", "elements/materials/", "test_layers")
KERNEL = ("elements/", "contact/distances/", "contact/shapes/", "core/math/")
WORLD = ("elements/laws/test_energy_laws",)
SOAK = (
    *("lab/", "demos/", "cli/"),
    *(
        "solver/integrators/test_implicit_euler",
        "solver/integrators/test_motion",
        "contact/test_implicit_contact",
    ),
    *("solver/test_threads", "solver/test_long_steps", "solver/test_plasticity", "solver/test_gpu_launch"),
    *("solver/test_damping_ratio", "world/test_bodies", "world/test_pools", "world/test_finite_readout"),
    *("elements/laws/test_anisotropy", "control/test_materials", "bodies/test_particle_bodies"),
    *("bodies/test_stress", "bodies/test_states"),
    *("fracture/test_cutting", "fracture/test_cut_snapshots"),
    # What starts processes, or compiles a world of its own, to look after something else than physics.
    *("world/test_warm_up", "persistence/test_recorder", "solver/test_kernel_cache"),
    *(f"core/test_threads.py::test_{name}" for name in ("a_", "worlds_that_compile")),
    *(f"core/test_runtime.py::test_{name}" for name in ("starting_again", "the_threads_that_work")),
    *(f"world/test_public_face.py::test_{name}" for name in ("every", "a_", "all_that", "nothing")),
    *(f"persistence/test_snapshot.py::test_{name}" for name in ("rest_shapes", "other_integrators")),
    *("control/test_joints.py::test_a_recording", "test_readme.py::test_the_level"),
)
"""Tiers, by the beginnings of files or tests. SOAK compiles or runs for more than some 40 s with an empty
cache and is left to `make test-all`; NUMPY runs no kernel, KERNEL some by themselves; the rest, and
what is named in WORLD, are whole worlds."""


def tier_of(item):
    """The marker of a test."""
    file = item.nodeid.removeprefix("tests/")
    tiers = {"soak": SOAK, "numpy": NUMPY, "world": WORLD, "kernel": KERNEL}
    return next((name for name, starts in tiers.items() if file.startswith(starts)), "world")


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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        item.add_marker(tier_of(item))
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
def share_the_kernels():
    """Worlds of all tests have room for as much: those of the same structure then take over each other's
    fields, with the kernels that are compiled for them. Not where every index is checked: one that is wrong
    would find room."""
    if os.environ.get(DEBUG) == "1":
        return
    LEAST.update(particles=2048, edges=8192, blocks=1024, triangles=4096, outer=2048, rings=2048, bodies=16)


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


ASSETS = Path(__file__).parents[1] / "assets"


@pytest.fixture(scope="session")
def thesis_mesh():
    """The thesis's sphere, diameter about 2 m."""
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
    """Builds a world with one body, without a floor where the body lies at the origin. Returns both."""

    def build(mesh, material, world_options=None, **body_options):
        usual = {} if "position" in body_options else {"floor": None}
        world = World(**{**usual, **(world_options or {})})
        body = world.add_body(mesh, material, **{"law": "virial", **body_options})
        world.build()
        return world, body

    return build


@pytest.fixture
def empty(play):
    """The built world with pools of a test file's `play`, and their assets, without bodies."""
    world, kinds = play
    for body in world.bodies:
        world.despawn(body)
    return world, kinds
