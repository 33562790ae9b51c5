"""The native library plays recorded games as Python does, bit for bit."""

import subprocess
import sys
from pathlib import Path

import pytest
from games import Player
from scenes import GAMES

from taichi_soft.export.meshes import CREASE

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
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


def native_lines(play, folder, game, *prefix):
    done = subprocess.run(
        [*prefix, str(play), str(folder)], input="\n".join(game), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def drawn(world):
    """How Python draws what the world file's meshes are."""
    return [lambda body: body.render_mesh(crease=CREASE)] * len(set(world._context.slots.assets))


@pytest.mark.parametrize("name", GAMES)
def test_a_game_without_python_has_the_same_bits(name, export, play):
    make, game = GAMES[name]
    calls = list(game())
    found = native_lines(play, export(name), calls)
    world = make()
    expected = Player(world, drawn(world)).play(calls)
    assert len(set(expected)) > 400  # something moves
    differing = [i for i, (a, b) in enumerate(zip(expected, found, strict=True)) if a != b]
    assert differing == []


@pytest.mark.parametrize("name", ["heap", "free"])
def test_a_game_has_the_same_bits_on_one_core(name, export, play):
    calls = list(GAMES[name][1]())
    folder = export(name)
    assert native_lines(play, folder, calls, "taskset", "-c", "0") == native_lines(play, folder, calls)
