"""Kernels that are compiled for a game before its first start, in a folder that ships with the game."""

import os
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.soak

GAME = """
from taichi_soft import Material, World, box


def make_world():
    world = World()
    world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000.0), position=(0, 0, 2))
    world.build()
    return world


def not_built():
    return World()


def nothing():
    return None
"""

PLAY = """
import logging, sys
logging.basicConfig(level=logging.DEBUG, format="%(message)s", stream=sys.stdout)
from game import make_world
world = make_world()
world.warm_up()
world.step(1 / 60)
"""


def run(folder, *arguments, **environment):
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, **environment},
        timeout=300,
    )


def warm(folder, *arguments):
    return run(folder, "-m", "taichi_soft", "warm", *arguments)


def kernels_in(folder):
    return {path.name for path in folder.glob("*.tic")}


@pytest.mark.guard
def test_a_game_compiles_nothing_where_its_kernels_came_with_it(tmp_path):
    (tmp_path / "game.py").write_text(GAME)
    done = warm(tmp_path, "game.py:make_world", "--out", "kernels")
    assert done.returncode == 0, done.stderr
    assert "1 world in" in done.stdout
    shutil.move(tmp_path / "kernels", tmp_path / "shipped")
    there = kernels_in(tmp_path / "shipped")
    played = run(tmp_path, "-c", PLAY, TI_OFFLINE_CACHE_FILE_PATH=str(tmp_path / "shipped"))
    assert sum(line.endswith("from the cache") for line in played.stdout.splitlines()) > 20, played.stderr
    assert kernels_in(tmp_path / "shipped") == there


@pytest.mark.parametrize(
    ("worlds", "reason"),
    [
        ("game.py", "must be like game.py:make_world"),
        ("nowhere.py:make_world", "cannot import 'nowhere.py'"),
        ("game.py:make_worlds", "has no function 'make_worlds'"),
        ("game.py:not_built", "build"),
        ("game.py:nothing", "must return a built World, or several, got None"),
    ],
)
def test_what_makes_no_world_is_one_line(tmp_path, worlds, reason):
    (tmp_path / "game.py").write_text(GAME)
    done = warm(tmp_path, worlds)
    assert done.returncode == 1
    assert reason in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
