"""Recorded games on the platforms that can be played here: under qemu and Wine. By hand:

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
from native_build import ROOT
from scenes import GAMES
from test_kept_bits import bits_of

NATIVE = ROOT / "engine_adapter" / "native"


@dataclass(frozen=True)
class Runner:
    """What plays the programs of a platform here."""

    platform: str
    command: tuple[str, ...] = ()
    needs: str = ""  # a file or a program
    package: str = ""  # of Debian's, that has it

    @property
    def is_here(self):
        return not self.needs or Path(self.needs).exists() or shutil.which(self.needs) is not None


RUNNERS = {
    "x86-64-v3": Runner("linux-x64"),
    "x86-64-v2": Runner("linux-x64", ("qemu-x86_64", "-cpu", "Nehalem"), "qemu-x86_64", "qemu-user"),
    "arm64": Runner(
        "linux-arm64",
        ("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"),
        "/usr/aarch64-linux-gnu/lib/ld-linux-aarch64.so.1",
        "qemu-user libc6-arm64-cross",
    ),
    "Windows": Runner("windows-x64", ("wine",), "wine", "wine64 wine"),
}
"""By what a table calls them."""


def build_for(platform, folder, *targets):
    """Build the library and programs for a platform, with zig."""
    zig = Path(find_spec("ziglang").origin).parent / "zig"
    settings = [f"-DPLATFORM={platform}", f"-DZIG={zig}", f"-DCMAKE_TOOLCHAIN_FILE={NATIVE / 'zig.cmake'}"]
    build = ["--build", folder, "--target", *targets, "-j2"]
    for command in (["-S", NATIVE, "-B", folder, "-DTAICHI_SOFT_TESTS=ON", *settings], build):
        done = subprocess.run(["cmake", *map(str, command)], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return folder


def played(name, runner, program, folder):
    """Hashes of what a game tells there: see `digests`.

    Args: program: of `tests/play.c`, without the end of its name; folder: the world file.
    """
    file = program.with_suffix(".exe") if runner.platform.startswith("windows") else program
    quiet = {**os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(program.parent / "wine")}
    return digests(lines_of([*runner.command, file, folder], list(GAMES[name][1]()), env=quiet))


def main():
    """Print the table. Returns: the exit status, 1 where two platforms differ."""
    runners = {name: each for name, each in RUNNERS.items() if each.is_here}
    for name in RUNNERS.keys() - runners.keys():
        print(f"{name} is left out: it needs {RUNNERS[name].package}")
    with tempfile.TemporaryDirectory() as place:
        programs = {}
        for platform in dict.fromkeys(each.platform for each in runners.values()):
            print(f"building for {platform}", flush=True)
            programs[platform] = build_for(platform, Path(place) / platform, "play") / "play"
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
