"""The native library plays recorded games as Python does, bit for bit."""

import subprocess

import pytest
from games import Player
from scenes import GAMES

from taichi_soft.export.meshes import CREASE


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
