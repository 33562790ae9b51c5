"""The setup script where something is missing: one clear line. Interpreters are stand-ins."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

OLD = 'case "$2" in *version_info*) exit 1;; *) echo 3.9.2;; esac'
NO_VENV = 'case "$2" in *ensurepip*) exit 1;; *) exit 0;; esac'
NO_NETWORK = """
case "$1 $2" in
  "-m venv") mkdir -p "$4/bin"; cp "$0" "$4/bin/python";;
  "-m pip") echo "ERROR: no network" >&2; exit 1;;
esac
"""
OLD_PIP = """
case "$1 $2" in
  "-m venv") mkdir -p "$4/bin"; cp "$0" "$4/bin/python";;
  "-m ensurepip") echo 'echo installs: "$@"' > "$(dirname "$0")/pip";;
  "-m pip") test -e "$(dirname "$0")/pip" && shift 2 && . "$(dirname "$0")/pip";;
esac
"""
NEW_PIP = """
case "$1 $2" in
  "-m venv") mkdir -p "$4/bin"; cp "$0" "$4/bin/python";;
  "-m ensurepip") exit 1;;
  "-m pip") test "$3" = --python && shift 4 && echo installs: "$@";;
esac
"""


@pytest.fixture
def setup(tmp_path):
    """Runs setup.sh with stand-ins for programs by name, and nothing else on the path unless `tools`."""

    def run(programs, *, tools=False, **environment):
        folder = tmp_path / "bin"
        folder.mkdir()
        for name, script in programs.items():
            (folder / name).write_text(f"#!/bin/sh\n{script}\n")
            (folder / name).chmod(0o755)
        path = f"{folder}:/usr/bin:/bin" if tools else str(folder)
        return subprocess.run(
            ["/bin/sh", str(ROOT / "setup.sh"), str(tmp_path / "venv"), "demo"],
            env={"PATH": path, **environment},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


@pytest.mark.parametrize(
    ("programs", "said"),
    [
        ({}, "no Python found. Install Python 3.10, 3.11, 3.12 or 3.13."),
        ({"python3": OLD}, "python3 is Python 3.9.2, for which Taichi has no wheels. Install Python 3.10"),
        ({"python3": OLD, "python3.12": NO_VENV}, "python3.12 has no venv module. Install it"),
        ({"uv": 'test "$1" = python'}, "uv found no Python 3.10 to 3.13"),
    ],
)
def test_what_is_missing_is_said_in_one_line(setup, programs, said):
    done = setup(programs, tools="uv" in programs)
    assert done.returncode == 1
    assert "2/2" not in done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"taichi-soft: {said}")


def test_an_interpreter_can_be_named(setup):
    done = setup({"python3": "exit 0", "mine": OLD}, PYTHON="mine")
    assert done.returncode == 1
    assert done.stderr.startswith("taichi-soft: mine is Python 3.9.2")


def test_a_failed_installation_ends_with_what_to_do(setup):
    done = setup({"mine": NO_NETWORK}, tools=True, PYTHON="mine")
    assert done.returncode == 1
    assert "2/2 installing taichi-soft[demo]" in done.stdout
    first, last = done.stderr.splitlines()
    assert first == "ERROR: no network"
    assert last.startswith("taichi-soft: the packages could not be installed")


@pytest.mark.parametrize("program", [OLD_PIP, NEW_PIP])
def test_an_environment_gets_a_pip_from_whatever_the_interpreter_has(setup, program):
    done = setup({"mine": program}, tools=True, PYTHON="mine")
    assert done.returncode == 0, done.stderr
    (said,) = (line for line in done.stdout.splitlines() if line.startswith("installs: install"))
    assert said.endswith("-e .[demo]")
    assert (" pip -e" in said) == (program is NEW_PIP)
