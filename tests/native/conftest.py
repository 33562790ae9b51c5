"""The native library, built once for all tests."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))  # what the tests of this folder share


def build(folder, *options):
    """Build the library and the programs of its tests. Returns: the folder."""
    missing = [tool for tool in ("cmake", "g++") if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"needs {' and '.join(missing)}, to build the native library")
    import taichi

    source = ROOT / "engine_adapter" / "native"
    settings = [f"-DTAICHI_DIR={taichi.__path__[0]}", "-DTAICHI_SOFT_TESTS=ON", *options]
    for command in (["-S", str(source), "-B", str(folder), *settings], ["--build", str(folder), "-j2"]):
        done = subprocess.run(["cmake", *command], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


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
