"""The native library, built together with the programs of its tests."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


NATIVE = ROOT / "engine_adapter" / "native"


def build(folder, *options, targets=()):
    """Build the library and the programs of its tests, or only some of them. Returns: the folder."""
    missing = [tool for tool in ("cmake", "g++") if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"needs {' and '.join(missing)}, to build the native library")
    settings = ["-S", NATIVE, "-B", folder, "-DTAICHI_SOFT_TESTS=ON", *options]
    wanted = ["--target", *targets] if targets else []
    for arguments in (settings, ["--build", folder, "-j2", *wanted]):
        done = subprocess.run(["cmake", *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder
