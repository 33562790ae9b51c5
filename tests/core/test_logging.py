"""Decisions of the package appear in the log of a program, and nowhere else."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.soak

PROGRAM = """
import logging
{setup}
from taichi_soft import Material, World, box, init
init("cpu", threads=1)
world = World()
world.add_body(box(), Material(2e5, 0.3, 1000), position=(0, 0, 1))
world.build()
world.step(1 / 60)
"""


def run(setup=""):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(setup=setup)], capture_output=True, text=True, check=True
    )
    return done.stdout, done.stderr


def test_by_default_nothing_is_printed():
    assert run() == ("", "")


def test_device_schedule_substeps_and_compile_times_are_logged():
    output, log = run("logging.basicConfig(level=logging.DEBUG)")
    assert output == ""
    lines = [line.split(":", 2) for line in log.splitlines() if ":taichi_soft" in line]
    said = {level: [text for each, _, text in lines if each == level] for level in ("INFO", "DEBUG")}
    assert any("Taichi runs on cpu with 1 threads" in text for text in said["INFO"])
    assert any("schedule per_body, leapfrog, with contact" in text for text in said["INFO"])
    assert any("a step of 0.0166667 s is made in" in text for text in said["INFO"])
    assert any(text.startswith("kernel step_islands took ") for text in said["DEBUG"])
    names = [text.split()[1] for text in said["DEBUG"]]
    assert {"spawn_body", "step_islands"} <= set(names)
