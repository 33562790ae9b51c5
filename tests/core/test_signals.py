"""The command line ends cleanly on a signal at any time, and other programs keep their signal handlers."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are those of POSIX")


@pytest.fixture
def interrupted_import(tmp_path):
    """An environment in which Ctrl-C is pressed when Taichi is imported."""
    (tmp_path / "taichi.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)\n")
    return {**os.environ, "PYTHONPATH": str(tmp_path)}


@pytest.mark.parametrize("command", [["taichi_soft", "info"], ["lab", "report", "--list"]])
def test_ctrl_c_while_the_command_is_imported_is_one_line(interrupted_import, command):
    done = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=ROOT, env=interrupted_import, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_ctrl_c_while_another_program_imports_the_package_is_its_own(interrupted_import):
    script = """
try:
    import taichi_soft
except KeyboardInterrupt:
    print("mine")
"""
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT, env=interrupted_import, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "mine\n"), done.stderr


@pytest.mark.soak
@pytest.mark.parametrize(
    ("number", "status", "said"), [("SIGTERM", 143, ""), ("SIGINT", 130, "interrupted\n")]
)
def test_a_film_that_is_ended_leaves_no_part_behind(tmp_path, number, status, said):
    film = tmp_path / "film.mp4"
    command = ["demo", "bounce", "--seconds", "600", "--size", "64x48", "--out", str(film), "--threads", "1"]
    command = [sys.executable, "-m", "taichi_soft", *command]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as running:
        waits_until = time.monotonic() + 100
        while not list(tmp_path.iterdir()):
            assert running.poll() is None
            assert time.monotonic() < waits_until
            time.sleep(0.05)
        running.send_signal(getattr(signal, number))
        assert running.communicate(timeout=100)[1] == said
    assert running.returncode == status
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_taichi_starts_or_makes_fields_leaves_it_whole():
    """Pressed within each, by the code that is called there."""
    script = """
import os, signal, time
from taichi_soft import Material, World, box, init
from taichi_soft.bodies import fields
from taichi_soft.core import runtime
def pressed_in(inner):
    def call(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.2)
        return inner(*arguments, **options)
    return call
world = World()
world.add_body(box(cells=(1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 1))
for place, name in ((runtime.ti, "init"), (fields, "Loader")):
    inner = getattr(place, name)
    setattr(place, name, pressed_in(inner))
    try:
        world.build()
    except KeyboardInterrupt:
        print(name, world.is_built)
    setattr(place, name, inner)
world.build()
world.step(1 / 60)
print(init().arch)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=100
    )
    assert (done.returncode, done.stdout) == (0, "init False\nLoader False\ncpu\n"), done.stderr
