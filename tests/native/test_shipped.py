"""A game's package with its licences is sufficient to build and play the sample, or to play in Godot."""

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from godot_build import SCRIPTS, told
from native_build import ROOT

pytestmark = [pytest.mark.soak, pytest.mark.guard]


def test_the_sample_is_built_and_played_with_what_is_shipped_alone(native, export, tmp_path):
    ship = tmp_path / "ship"
    done = subprocess.run(["cmake", "--install", native, "--prefix", ship], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    names = {str(each.relative_to(ship)) for each in ship.rglob("*") if each.is_file()}
    needed = {"libtaichi_soft.so", "LICENSE"}
    assert needed | {"include/taichi_soft.h", "include/taichi_soft.hpp", "csharp/TaichiSoft.cs"} <= names
    program = ship / "own"
    command = ["g++", "-std=c++17", "-Wall", "-Werror", str(ship / "sample" / "game.cpp"), "-o", str(program)]
    command += [f"-I{ship / 'include'}", f"-L{ship}", "-ltaichi_soft", "-Wl,-rpath,$ORIGIN"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    folder = shutil.copytree(export("heap"), ship / "game.softworld")
    done = subprocess.run([program, folder], capture_output=True, text=True, cwd="/")
    assert done.returncode == 1
    # It reads the file, of another game.
    assert done.stderr.startswith("error: unknown name ball: give one of ")


def blocks(page, heading):
    """Return the contents of a section: its commands, and its files by name."""
    section = re.search(rf"^## {heading}\n(.*?)(?=^## )", page, re.DOTALL | re.MULTILINE).group(1)
    files = dict(re.findall(r"^`([\w.]+)` [^\n]*:\n\n```\w+\n(.*?)^```", section, re.DOTALL | re.MULTILINE))
    prose = re.sub(r"^```.*?^```", "", section, flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"^    (\S.*)$", prose, re.MULTILINE), files


def require_on_the_ground(middles, lowest):
    """It fell, lies on the ground, and hardly moves any more.

    What is drawn is a skin on a cage with cells of 0.11 m. It bends smoothly where they have corners, and so
    dips into the ground: when it hits it, and at a foot that is bent over."""
    middles = np.array(middles)
    assert np.isfinite(middles).all()
    assert np.ptp(middles[:60, 1]) > 0.4
    assert middles[:, 1].min() > 0.05
    assert min(lowest) > -0.1
    assert abs(lowest[-1]) < 0.055
    assert 0.1 < middles[-1, 1] < 0.3  # it is half a metre high
    assert np.ptp(middles[-30:], axis=0).max() < 0.06  # in half a second


def test_a_newcomer_plays_in_godot_with_the_zip_alone(engine, libraries, tmp_path):
    """The commands and files of docs/godot.md as they are printed, in a folder with nothing but the .zip.

    `godot3-runner` is a Godot without a window here, with a script that looks on; `unzip` is Python's."""
    place, tools, ship = tmp_path / "newcomer", tmp_path / "tools", tmp_path / "ship"
    place.mkdir(), tools.mkdir()
    done = subprocess.run(["cpack", "-B", ship], cwd=libraries.parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (package,) = ship.glob("*.zip")
    shutil.move(package, place)
    script = SCRIPTS / "newcomer.gd"
    look_on = f'cp "{script}" "$2"\nexec "{engine}" "$@" --fixed-fps 60 -s {script.name}\n'
    for name, text in {
        "unzip": f'exec "{sys.executable}" -m zipfile -e "$1" .\n',
        "godot3-runner": look_on,
    }.items():
        (tools / name).write_text(f"#!/bin/sh\n{text}")
        (tools / name).chmod(0o755)
    environment = {"PATH": f"{tools}:/usr/bin:/bin", "HOME": str(tmp_path)}

    def entered(commands):
        command = ["sh", "-e", "-c", "\n".join(commands)]
        done = subprocess.run(
            command, cwd=place, env=environment, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "SCRIPT ERROR" not in done.stdout + done.stderr, done.stderr
        return done.stdout

    page = (ROOT / "docs" / "godot.md").read_text(encoding="utf-8")
    commands, _ = blocks(page, "Tutorial: falling elephants")
    found = told(entered(commands))
    demo = place / package.stem
    licences = {"LICENSE", "LICENSE-godot-headers"}
    assert licences <= {path.name for path in (demo / "addons" / "taichi_soft").iterdir()}
    (dropped,) = set(found["middles"]) - {"Rider", "Block"}
    require_on_the_ground(found["middles"][dropped], found["lowest"][dropped])
    commands, files = blocks(page, "A first scene of your own")
    assert set(files) == {"project.godot", "main.tscn", "main.gd"}
    entered(commands[:-1])
    for name, text in files.items():
        (place / "first" / name).write_text(text, encoding="utf-8")
    found = told(entered(commands[-1:]))
    block, *elephants = sorted(found["middles"], key=lambda name: found["middles"][name][0][1])
    assert len(elephants) == 2
    for name in elephants:
        require_on_the_ground(found["middles"][name], found["lowest"][name])
    assert np.ptp(found["middles"][block], axis=0).max() < 0.05
