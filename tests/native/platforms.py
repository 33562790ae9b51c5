"""Recorded games on platforms that can be played here: under qemu and Wine, in node and Chromium. By hand:

    python tests/native/platforms.py

prints a table of what all of them give. It takes a quarter of an hour.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
if __name__ == "__main__":
    sys.path[:0] = [str(HERE), str(HERE.parent / "shared"), str(HERE.parents[1])]

# ruff: noqa: E402
from games import digests, lines_of
from native_build import NATIVE, build
from scenes import GAMES
from test_kept_bits import bits_of


@dataclass(frozen=True)
class Runner:
    """What plays the programs of a platform here."""

    platform: str
    command: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()  # files, programs or Python's packages
    source: str = ""  # of these

    @property
    def is_here(self):
        return all(Path(each).exists() or shutil.which(each) or _is_package(each) for each in self.needs)


def _is_package(name):
    return name.isidentifier() and find_spec(name) is not None


_ARM64 = "/usr/aarch64-linux-gnu"
RUNNERS = {
    "x86-64-v3": Runner("linux-x64"),
    "x86-64-v2": Runner(
        "linux-x64", ("qemu-x86_64", "-cpu", "Nehalem"), ("qemu-x86_64",), "apt-get install qemu-user"
    ),
    "arm64": Runner(
        "linux-arm64",
        ("qemu-aarch64", "-L", _ARM64),
        ("qemu-aarch64", f"{_ARM64}/lib/ld-linux-aarch64.so.1"),
        "apt-get install qemu-user libc6-arm64-cross",
    ),
    "Windows": Runner("windows-x64", ("wine",), ("wine",), "apt-get install wine64 wine"),
    "node": Runner("web", ("node", str(HERE / "play.mjs")), ("node",), "apt-get install nodejs"),
    "Chromium": Runner(
        "web",
        (sys.executable, str(HERE / "play_in_browser.py")),
        ("chromium", "playwright"),
        "apt-get install chromium, and make setup",
    ),
}
"""By what a table calls them. In a browser there is a world and no program of its own."""


def player_for(platform, folder):
    """The program that plays games on a platform, built with zig in a folder; none for the web."""
    if platform == "web":
        return None
    zig = Path(find_spec("ziglang").origin).parent / "zig"
    settings = [f"-DPLATFORM={platform}", f"-DZIG={zig}", f"-DCMAKE_TOOLCHAIN_FILE={NATIVE / 'zig.cmake'}"]
    program = build(folder, *settings, targets=["play"]) / "play"
    return program.with_suffix(".exe") if platform.startswith("windows") else program


def played(name, runner, program, world):
    """Hashes of what a game tells there: see `digests`.

    Args: program: see `player_for`; world: folder of the world file.
    """
    quiet = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(world.parent / "wine")}
    programs = [] if program is None else [program]
    return digests(lines_of([*runner.command, *programs, world], list(GAMES[name][1]()), env=quiet))


def main():
    """Print the table. Returns: the exit status, 1 where two platforms differ."""
    runners = {name: each for name, each in RUNNERS.items() if each.is_here}
    for name in RUNNERS.keys() - runners.keys():
        print(f"{name} is left out: {RUNNERS[name].source}")
    with tempfile.TemporaryDirectory() as place:
        programs = {}
        for platform in dict.fromkeys(each.platform for each in runners.values()):
            print(f"building for {platform}", flush=True)
            programs[platform] = player_for(platform, Path(place) / platform)
        print("game", "Python", *runners, sep=" | ")
        differing = 0
        for name in GAMES:
            world = Path(place) / f"{name}.softworld"
            scene, targets = f"{HERE / 'scenes.py'}:{name}", ",".join(programs)
            export = ["-m", "taichi_soft", "export", scene, "--out", str(world), "--for", targets]
            subprocess.run([sys.executable, *export], check=True, stdout=subprocess.DEVNULL)
            found = {"Python": bits_of(name)}
            for label, each in runners.items():
                found[label] = played(name, each, programs[each.platform], world)
            differing += len({tuple(each) for each in found.values()}) > 1
            print(name, *(each[-1] for each in found.values()), sep=" | ", flush=True)
    print("all are equal, every 60 lines" if not differing else f"{differing} games differ")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
