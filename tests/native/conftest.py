"""The native library, built once for all tests."""

import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # what the tests of this folder share

from native_build import build  # noqa: E402

from taichi_soft.bodies.capacity import LEAST  # noqa: E402

OWN = dict(LEAST)  # before tests share theirs


@pytest.fixture(autouse=True)
def own_room():
    """Worlds have the room that their exports have: kernels for another one may round otherwise."""
    kept = dict(LEAST)
    LEAST.update(OWN)
    yield
    LEAST.update(kept)


@pytest.fixture(scope="session")
def native(tmp_path_factory):
    """Folder of the library."""
    return build(tmp_path_factory.mktemp("native"))


@pytest.fixture(scope="session")
def play(native):
    """The program that plays recorded games."""
    return native / "play"


@pytest.fixture(scope="session")
def export(tmp_path_factory):
    """A function that exports a scene in a process of its own, once, and returns its folder."""
    made = {}

    def exported(name, *options):
        key = (name, *options)
        if key not in made:
            folder = tmp_path_factory.mktemp("worlds") / f"{name}.softworld"
            command = ["-m", "taichi_soft", "export", f"{HERE / 'scenes.py'}:{name}", "--out", str(folder)]
            done = subprocess.run([sys.executable, *command, *options], capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            made[key] = folder
        return made[key]

    return exported
