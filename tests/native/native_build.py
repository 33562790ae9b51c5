"""The native library, built with what its tests run."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def build(folder, *options):
    """Build the library and the programs of its tests. Returns: the folder."""
    missing = [tool for tool in ("cmake", "g++") if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"needs {' and '.join(missing)}, to build the native library")
    source = ROOT / "engine_adapter" / "native"
    settings = ["-DTAICHI_SOFT_TESTS=ON", *options]
    for command in (["-S", str(source), "-B", str(folder), *settings], ["--build", str(folder), "-j2"]):
        done = subprocess.run(["cmake", *command], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder
