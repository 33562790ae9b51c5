"""Soaks by folder: `pytest --since REVISION` runs the soaks that guard the changed files."""

import subprocess
from pathlib import PurePosixPath

SOAKS = {
    "assets": "demos/test_demos.py test_first_steps.py",
    "demos": "demos docs/test_gallery.py docs/test_playing_gallery.py",
    "docs": "docs test_first_steps.py",
    "engine_adapter": "engine_adapter demos/test_panda3d_game.py profiling/test_kept_budget.py",
    "engine_adapter/godot": (
        "native/test_godot.py native/test_godot4.py native/test_godot4_nodes.py native/test_shipped.py"
    ),
    "engine_adapter/native": "native",
    "engine_adapter/panda3d": "demos/test_panda3d_bullet.py demos/test_panda3d_game.py",
    "engine_adapter/web": (
        "native/test_web.py native/test_network.py native/test_shipped.py docs/test_playing_gallery.py"
    ),
    "hatch_build.py": "test_package.py",
    "lab": "lab",
    "lab/cli": "lab/cli lab/report/test_command.py",
    "lab/contact": "lab/contact",
    "lab/drop_test": "lab/drop_test lab/cli",
    "lab/experiments": "lab/experiments",
    "lab/peers": "lab/peers",
    "lab/report": "lab/report lab/experiments/test_whole_report.py",
    "lab/sweep": "lab/sweep lab/cli",
    "pyproject.toml": "test_package.py",
    "setup.sh": "test_package.py",
    "taichi_soft": "core/test_logging.py cli test_package.py",
    "taichi_soft/bake": "bake cli/test_bake.py",
    "taichi_soft/bodies": "bodies world bounds/test_worlds.py",
    "taichi_soft/cages": "cages",
    "taichi_soft/cli": "cli test_first_steps.py",
    "taichi_soft/contact": (
        "contact demos/test_demos.py demos/test_panda3d_bullet.py native/test_same_bits.py bounds"
    ),
    "taichi_soft/control": (
        "control native/test_orders.py native/test_joints_and_motors.py demos/test_panda3d_game.py "
        "bounds/test_worlds.py"
    ),
    "taichi_soft/core": (
        "core solver/test_kernel_cache.py solver/test_gpu_launch.py solver/test_long_steps.py "
        "cli/test_warm.py"
    ),
    "taichi_soft/doctor": "doctor",
    "taichi_soft/elements": (
        "elements solver/integrators solver/test_damping_ratio.py solver/test_recovery.py "
        "bodies/test_plasticity.py bodies/test_stress.py control/test_materials.py lab/experiments"
    ),
    "taichi_soft/events": "bodies/test_stress.py native/test_orders.py",
    "taichi_soft/export": "native",
    "taichi_soft/feel": "feel",
    "taichi_soft/fracture": "fracture bounds/test_worlds.py",
    "taichi_soft/levels": "levels native/test_levels.py bounds/test_worlds.py",
    "taichi_soft/live": "live",
    "taichi_soft/meshing": "meshing cages bodies/test_particle_bodies.py lab/peers",
    "taichi_soft/persistence": (
        "persistence fracture/test_cut_snapshots.py solver/test_skipping.py native/test_network.py"
    ),
    "taichi_soft/profiling": "profiling cli/test_cli.py",
    "taichi_soft/queries": "native/test_orders.py",
    "taichi_soft/render": (
        "render cli/test_film.py demos/test_demos.py docs/test_gallery.py test_first_steps.py "
        "bounds/test_pictures.py"
    ),
    "taichi_soft/solver": (
        "solver world contact/test_implicit_contact.py core/taichi_workarounds "
        "elements/laws/test_anisotropy.py bodies/test_states.py bounds/test_worlds.py"
    ),
    "taichi_soft/world": "world bodies/test_states.py persistence",
}
"""Soaks (files and folders of `tests`) by the folder or file of the checkout that they guard. The longest
path to a changed file counts. Soaks that are marked `guard` run whatever has changed."""


def changed_since(revision):
    """Return the files of the checkout that differ from a revision.

    Raises: ValueError: git does not know the revision.
    """
    command = ["git", "diff", "--name-only", "--no-renames", "--relative", revision, "--"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise ValueError(f"--since {revision}: {done.stderr.strip()}")
    return done.stdout.splitlines()


def soaks_of(files):
    """Return the soaks that guard these files of the checkout, and the soaks that are among the files."""
    found = set()
    for file in map(PurePosixPath, files):
        if file.parts[0] == "tests":
            found.add(file.relative_to("tests").as_posix())
        places = [path.as_posix() for path in (file, *file.parents)]
        found.update(next((SOAKS[place].split() for place in places if place in SOAKS), ()))
    return found


def is_named(file, soaks):
    """True if a file of `tests` is one of these soaks or in one of these folders."""
    return any(path.as_posix() in soaks for path in (file, *file.parents))


def left_out(items, folder, soaks):
    """Return the soaks among tests that neither always run nor are named.

    Args: folder: folder of the tests.
    """
    return [
        item
        for item in items
        if item.get_closest_marker("soak")
        and not item.get_closest_marker("guard")
        and not is_named(item.path.relative_to(folder), soaks)
    ]
