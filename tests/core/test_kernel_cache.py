"""Kernels that one process compiled are there for the next, whatever became of others meanwhile."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import taichi_soft

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
    with subprocess.Popen([sys.executable, "-c", code]):  # for longer than a program runs that does not wait
        assert len(run_program()) > 0


def is_marked(function, mark):
    return any(ast.unparse(each).endswith(mark) for each in function.decorator_list)


def real_functions_called(name, functions, seen):
    """Names of real functions that a function calls, by itself or in functions that are copied into it.

    Functions are known by name; one that is given as an argument has to be named as its parameter.
    """
    found = set()
    for function in functions.get(name, []):
        for node in ast.walk(function):
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else None
            if called in functions and called not in seen:
                seen.add(called)
                is_end = any(is_marked(each, "real_func") for each in functions[called])
                found |= {called} if is_end else real_functions_called(called, functions, seen)
    return found


def test_a_kernel_or_real_function_calls_one_real_function_at_most():
    """Else a kernel's key holds them in the order of their addresses, which differs between processes."""
    functions = {}
    for path in Path(taichi_soft.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                functions.setdefault(node.name, []).append(node)
    callers = [
        name
        for name, each in functions.items()
        if any(is_marked(one, mark) for one in each for mark in ("real_func", "kernel"))
    ]
    called = {name: real_functions_called(name, functions, {name}) for name in callers}
    assert called["step_islands"] == {"run_job"}
    assert called["run_job"] == {"_do_other_phase"}
    assert {name: each for name, each in called.items() if len(each) > 1} == {}
