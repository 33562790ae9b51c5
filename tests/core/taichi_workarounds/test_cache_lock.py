"""Kernels that one process compiles are available to the next, even if other processes crash."""

import os
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.soak

PROGRAM = """
from taichi_soft import init
from taichi_soft.core.runtime import ti

init("cpu", threads=1)


@ti.kernel
def add(a: ti.i32, b: ti.i32) -> ti.i32:
    return a + b


assert add(2, 3) == 5
"""


@pytest.fixture
def run(tmp_path):
    """Runs a program with a kernel. Returns the files of kernels that are kept then."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    folder = tmp_path / "kernels"

    def run_program():
        environment = {**os.environ, "TI_OFFLINE_CACHE_FILE_PATH": str(folder)}
        subprocess.run([sys.executable, str(program)], check=True, env=environment, timeout=120)
        return list(folder.glob("*.tic"))

    return run_program, folder


def test_a_lock_left_by_a_killed_process_does_not_keep_kernels_from_being_kept(run):
    run_program, folder = run
    folder.mkdir()
    lock = folder / "ticache.lock"
    lock.touch()
    hour_ago = time.time() - 3600
    os.utime(lock, (hour_ago, hour_ago))
    assert len(run_program()) > 0
    assert not lock.exists()


def test_a_lock_that_another_process_holds_is_waited_for(run):
    run_program, folder = run
    folder.mkdir()
    lock = folder / "ticache.lock"
    lock.touch()
    code = f"import pathlib, time; time.sleep(6); pathlib.Path({str(lock)!r}).unlink()"
    with subprocess.Popen([sys.executable, "-c", code]):  # it runs longer than a program that does not wait
        assert len(run_program()) > 0
