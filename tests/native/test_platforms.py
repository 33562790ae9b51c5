"""Recorded games have the kept bits on every platform that can be played here, which `platforms.py` lists."""

import functools
import json
import os
import subprocess
import sys

import pytest
from games import lines_of
from native_build import NATIVE
from platforms import RUNNERS, built_for, played
from test_kept_bits import KEPT

pytestmark = pytest.mark.soak

PLAYED = (
    pytest.param("heap", marks=pytest.mark.guard),
    "joined",
    "laws",
)  # `make test-platforms`: all of them
TARGETS = ",".join(dict.fromkeys(each.platform for each in RUNNERS.values()))


@pytest.fixture(scope="session")
def program(tmp_path_factory):
    """A function that makes the player of games of a runner, once, and returns how it is called."""
    return functools.cache(lambda make: make(tmp_path_factory.mktemp("player")))


@pytest.mark.parametrize("name", PLAYED)
@pytest.mark.parametrize("label", RUNNERS)
def test_a_game_has_the_same_bits_on_another_platform(label, name, export, program):
    runner = RUNNERS[label]
    if not runner.is_here:
        pytest.skip(f"needs {' and '.join(runner.needs)}: {runner.source}")
    found = played(name, runner, program(runner.make), export(name, "--for", TARGETS))
    assert found == json.loads(KEPT.read_text())[name]


def test_the_sample_tells_the_same_on_windows(native, tmp_path):
    """Whole to the state's last bit, though the game moves its lift by a cosine of its own system."""
    windows = RUNNERS["Windows"]
    if not windows.is_here:
        pytest.skip(f"needs wine: {windows.source}")
    sample, folder = NATIVE / "sample" / "game.py", tmp_path / "game.softworld"
    export = ["export", str(sample), "--out", str(folder), "--for", "linux-x64,windows-x64"]
    subprocess.run([sys.executable, "-m", "taichi_soft", *export], check=True, capture_output=True)
    program = built_for("windows-x64", tmp_path / "windows", "game") / "game.exe"
    quiet = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(tmp_path / "wine")}
    found = lines_of([*windows.command, program, folder, "6"], [], env=quiet)
    assert found == lines_of([native / "game", folder, "6"], [])
    assert len(found) == 7
