"""The native library plays recorded games as Python does, bit for bit."""

import subprocess
import sys

import pytest
from games import Player, lines_of
from native_build import ROOT
from scenes import GAMES

from taichi_soft.export.meshes import CREASE
from taichi_soft.world.world import context_of_world

pytestmark = pytest.mark.soak


def drawn(world):
    """Return Python's render meshes of the world file: an asset's skins, or the surfaces of its levels."""
    found = []
    for asset in dict.fromkeys(context_of_world(world).slots.assets):
        found += [lambda body, i=i: body.render_meshes[i] for i in range(len(asset.skins))]
        found += [] if asset.skins else [lambda body: body.render_mesh(crease=CREASE)] * len(asset.levels)
    return found


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.guard if name == "heap" else ()) for name in GAMES]
)
def test_a_game_without_python_has_the_same_bits(name, export, play):
    make, game = GAMES[name]
    calls = list(game())
    found = lines_of([play, export(name)], calls)
    world = make()
    expected = Player(world, drawn(world)).play(calls)
    assert len(set(expected)) > 400  # something moves
    differing = [i for i, (a, b) in enumerate(zip(expected, found, strict=True)) if a != b]
    assert differing == []


def test_events_of_every_kind_happen_in_these_games(export, play):
    told = [
        text.split()
        for name in ("heap", "free", "surfaces")
        for text in lines_of([play, export(name)], GAMES[name][1]())
    ]
    assert {each[0] for each in told if len(each) == 6} == {"1", "2", "4", "8", "16", "32", "64"}


@pytest.mark.parametrize("name", ["heap", "free"])
def test_a_game_has_the_same_bits_on_one_core(name, export, play):
    calls = list(GAMES[name][1]())
    folder = export(name)
    assert lines_of(["taskset", "-c", "0", play, folder], calls) == lines_of([play, folder], calls)


@pytest.mark.guard
def test_the_sample_finds_what_its_script_named_and_plays_alike_every_time(native, tmp_path):
    """A ball more each second; the first is carried by the lift, whose top is between 0.2 and 0.8 m."""
    sample, folder = ROOT / "engine_adapter" / "native" / "sample" / "game.py", tmp_path / "game.softworld"
    command = [sys.executable, "-m", "taichi_soft", "export", str(sample), "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = [
        subprocess.run([native / "game", folder, "6"], capture_output=True, text=True).stdout
        for _ in range(2)
    ]
    assert told[0] == told[1]
    *lines, state = told[0].splitlines()
    assert state.startswith("state ")
    words = [text.split() for text in lines]
    assert [int(each[2]) for each in words] == [1, 2, 3, 4, 5, 6]
    assert all(0.4 < float(each[10]) < 1.6 for each in words[:4])
