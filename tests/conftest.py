"""For all tests: repeatable property tests, and buffers that fit nowhere."""

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

from taichi_soft import Material, World, box, init, load_mesh
from taichi_soft.bodies.capacity import LEAST
from taichi_soft.core.extras import missing_packages
from taichi_soft.core.runtime import DEBUG

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "shared"))  # what tests of several folders import

from shares import Shares, place_of  # noqa: E402

UNTIL = "TAICHI_SOFT_SOAKS_UNTIL"
"""Name of the environment variable with the time [s since 1970] after which no soak begins: `.ci/run` has so
long, and a slow machine leaves some out, which it names."""

ARCH = "TAICHI_SOFT_TEST_ARCH"
"""Name of the environment variable with which the tests run elsewhere than on the CPU: "cuda"."""

TIME_IS_UP = "a soak for which no time was left on this machine"

settings.register_profile("same every time", derandomize=True, deadline=None)
settings.load_profile("same every time")

NodeManager.EXIT_TIMEOUT = 300
"""How long a worker may take to end [s]. It keeps its kernels then; of a whole run that takes longer than the
10 s after which it would be killed, and the next run would find none."""

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that runs the tests behind `&` has them ignore Ctrl-C, and the processes that they start too.
    signal.signal(signal.SIGINT, signal.default_int_handler)

NUMPY = ("test_shares", "meshing/", "cages/", "elements/materials/", "bake/test_formats", "test_layers")
KERNEL = ("elements/", "contact/distances/", "contact/shapes/", "core/math/")
WORLD = ("elements/laws/test_energy_laws",)
SOAK = (
    *("lab/", "demos/", "cli/", "native/", "live/test_served", "live/test_page", "live/test_measuring"),
    "feel/test_material_from_feel.py::test_random_wishes",
    "feel/test_material_from_feel.py::test_what_cannot",
    *(
        "solver/integrators/test_implicit_euler",
        "solver/integrators/test_motion",
        "contact/test_implicit_contact",
        "contact/test_hulls",
    ),
    *("solver/test_threads", "solver/test_skipping", "solver/test_long_steps", "solver/test_gpu_launch"),
    *("solver/test_damping_ratio", "world/test_bodies", "world/test_pools", "world/test_finite_readout"),
    *("elements/laws/test_anisotropy", "control/test_materials", "bodies/test_particle_bodies"),
    *("bodies/test_stress", "bodies/test_states", "bodies/test_plasticity"),
    *("fracture/test_cutting", "fracture/test_cut_snapshots"),
    # What starts processes, or compiles a world of its own, to look after something else than physics.
    *("control/test_easing", "engine_adapter/test_refused_steps", "world/test_handles_at_any_time"),
    "contact/test_overlaps.py::test_30_bodies",
    "contact/test_overlaps.py::test_two_bodies_that_start_inside_each_other_come_apart_without_being_thrown[im",
    "docs/test_reference.py::test_an_example",
    *("world/test_warm_up", "persistence/test_recorder", "solver/test_kernel_cache"),
    *(f"core/test_threads.py::test_{name}" for name in ("a_", "worlds_that_compile")),
    *(f"core/test_runtime.py::test_{name}" for name in ("starting_again", "the_threads_that_work")),
    *(f"core/test_known_kernels.py::test_{name}" for name in ("a_later", "a_world", "a_machine")),
    *(f"core/test_known_kernels.py::test_{name}" for name in ("after_an_update", "what_is_missing")),
    "core/test_logging",
    *(f"world/test_public_face.py::test_{name}" for name in ("every", "a_", "all_that", "nothing")),
    "solver/test_recovery.py::test_a_wrecked_body_finds_its_shape_again[exact",
    *(f"persistence/test_snapshot.py::test_{name}" for name in ("rest_shapes", "other_integrators")),
    *(f"test_package.py::test_a_{name}" for name in ("source", "wheel")),
    "docs/test_pages.py::test_the_code",
    *(f"test_first_steps.py::test_the_{name}" for name in ("first_films", "documentation", "gallery")),
    *(f"docs/test_gallery.py::test_{name}" for name in ("a_demo_that", "a_film", "films_of")),
    "docs/test_playing_gallery",
    *(
        "control/test_joint_lives.py::test_a_recording",
        "levels/test_holding.py::test_recordings",
        "test_readme.py::test_the_level",
    ),
    *(f"levels/test_levels.py::test_{name}" for name in ("levels_in_contact", "after_warming", "warming")),
    "bake/test_bake.py::test_a_body_that_goes",
    # Worlds of kinds that one test has to itself; joints and motors by leapfrog are in `make test`.
    "control/test_motors.py::test_a_force_changes_momentum_by_force_times_time[i",
    "control/test_motors.py::test_a_torque_changes_angular_momentum_by_torque_times_time_and_momentum_by_nothing[la",
    *(f"control/test_joints.py::test_a_{name}" for name in ("joint_works", "rope_is_held")),
    "control/test_grabs.py::test_cloth_is_held",
    "control/test_attachments.py::test_what_is_dragged_too_far_in_a_step_without_retries",
    *(
        "solver/test_coarse_steps.py::test_what_one_may_ask_of_implicit_euler",
        "solver/test_floor.py::test_without",
    ),
    *("render/test_props.py::test_a_collider_is_drawn_on_its_way", "render/test_film.py::test_colors_of"),
    *("contact/test_narrow_phase.py::test_a_tip", "persistence/test_snapshot.py::test_a_rope"),
    # Meshers that are in none of the extras of `make test`.
    "cages/test_methods",
    # What takes long although its kernels are there.
    *(
        "cages/test_difficult_surfaces",
        "cages/test_cage.py::test_a_bar_along",
        "cages/test_thin.py::test_the_cell",
        "cages/test_thin.py::test_a_table_on",
    ),
    *("live/test_frame_file.py::test_a_reader", "live/test_uploads.py::test_a_name"),
    "render/test_renderer.py::test_same_bits",
    *("cages/test_thin.py::test_the_octaves", "contact/test_soft_contact.py::test_a_coarse_plate"),
    "contact/test_piles.py::test_a_block_bears_one_of_many_times_its_mass_for_a_minute[1000-50.0",
    "contact/test_colliders.py::test_a_sheet_of_1_cm_lands_without_freezing[0.01",
    *("core/test_kernel_cache.py::test_a_lock", "docs/test_pages.py::test_every_command"),
    *(
        "cages/test_cage.py::test_parts_that_do_not_touch",
        "contact/shapes/test_mesh_shape.py::test_one_thread",
    ),
    # Processes that compile worlds; the first one of its kind is in `make test`.
    *("core/test_signals.py::test_a_film", "core/test_runtime.py::test_more_threads"),
    *(
        f"core/test_runtime.py::test_{name}"
        for name in ("left_alone_a_thread", "left_alone_threads", "where_the_system")
    ),
)
"""Tiers, by the beginnings of files or tests. SOAK compiles or runs for more than some 40 s with an empty
cache and is left to `make test-all`; NUMPY runs no kernel, KERNEL some by themselves; the rest, and
what is named in WORLD, are whole worlds."""

VARIANTS = {
    "control/test_attachments": ("lazy_leapfrog", "implicit"),
    "control/test_grabs": ("implicit",),
    "control/test_pins": ("lazy_leapfrog", "implicit", "flat"),
    "control/test_motors": ("lazy_leapfrog", "implicit"),
    "control/test_surroundings": ("lazy_leapfrog", "implicit", "flat"),
    "control/test_joints": ("soft",),
    "solver/test_coarse_steps": ("flat",),
    "elements/laws/test_energy_laws": ("flat",),
    "elements/laws/": (
        *("face-exact", "face-linear-off", "face-linear-tolerant"),
        *("virial-exact-off", "virial-exact-tolerant", "exact-face"),
    ),
    "elements/laws/test_evaluation": ("face-linear-recover",),
    "elements/laws/test_gradients": ("virial-exact-recover", "virial-linear-off"),
    "fracture/test_tearing": ("virial", "st_venant_kirchhoff"),
    # What takes long although its kernels are there.
    "cages/test_cage": ("turned box", "capsule", "tube"),
    "cages/test_thin": ("ball", "a wall"),
    "meshing/test_locating.py::test_a_point_outside": ("torus",),
    "render/test_video.py::test_a_killed_film": (".webm", ".gif"),
    "solver/integrators/test_safe_step": ("cylinder", "cmpm"),
}
"""Soaks by the names of parameters, by the beginnings of files or tests. Other tests of `make test` have each
of these integrators, schedules and laws (`control/test_forces`, `control/test_impulses`), or one that differs
by a branch."""


NEEDS = {
    "lab/experiments/": "report",
    "lab/report/": "report",
    "lab/sweep/test_cluster": "cluster",
    "docs/test_pages.py::test_the_code_of_a_page_runs_from_top_to_bottom[panda3d": "panda3d",
    "docs/test_pages.py::test_code_of_a_page_imports_public_names_only[panda3d": "panda3d",
}
"""Extras that tests need beyond those of the extra `test`, by the beginnings of files."""


def is_soak(nodeid):
    """Whether a test is left to `make test-all`."""
    file, _, parameters = nodeid.removeprefix("tests/").partition("[")
    variants = [name for start, names in VARIANTS.items() if file.startswith(start) for name in names]
    return nodeid.removeprefix("tests/").startswith(SOAK) or any(name in parameters for name in variants)


def tier_of(item):
    """The marker of a test."""
    if is_soak(item.nodeid):
        return "soak"
    file = item.nodeid.removeprefix("tests/")
    tiers = {"numpy": NUMPY, "world": WORLD, "kernel": KERNEL}
    return next((name for name, starts in tiers.items() if file.startswith(starts)), "world")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    files = {path: i for i, path in enumerate(dict.fromkeys(item.path for item in items))}
    items.sort(key=lambda item: (place_of(item.nodeid), files[item.path], keeps_a_world(item)))
    for item in items:
        item.add_marker(tier_of(item))
        for start, extra in NEEDS.items():
            if item.nodeid.removeprefix("tests/").startswith(start):
                missing = missing_packages(extra)
                reason = f"needs {', '.join(missing)}: pip install 'taichi-soft[{extra}]'"
                item.add_marker(pytest.mark.skipif(bool(missing), reason=reason))


def keeps_a_world(item):
    """Whether a test may use what lives until the end of its file. Worlds of the other tests come before it:
    after it they would find its fields taken, and compile their kernels once more."""
    made = item._fixtureinfo.name2fixturedefs.values()
    return any(each[-1].scope == "module" for each in made)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    if is_soak(item.nodeid) and time.time() > float(os.environ.get(UNTIL, "inf")):
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
    """Where every extra is installed, as `.ci/run` has it, a test that is skipped tests nothing; but for one
    that needs a program which `.ci/run` could not install, and names."""
    if os.environ.get("TAICHI_SOFT_ALL_TESTS") == "1" and report.skipped and not hasattr(report, "wasxfail"):
        without = [*os.environ.get("TAICHI_SOFT_WITHOUT", "").split(), TIME_IS_UP]
        if any(package in str(report.longrepr[-1]) for package in without):
            return
        report.outcome = "failed"
        report.longrepr = f"skipped: {report.longrepr[-1]}"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    return Shares(config, log) if config.getvalue("dist") == "loadscope" else None


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
    LEAST.update(colliders=32, samples=32768)


@pytest.fixture(autouse=True, scope="session")
def share_the_cores():
    """Tests that run side by side take a core each: threads would wait for those of others."""
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
    """Makes what is no C-contiguous, writeable float32 array of shape (n, 3)."""
    return request.param


ASSETS = HERE.parent / "assets"


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
