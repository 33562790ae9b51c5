"""The commands of the README and of the first steps, in a fresh clone with nothing but what they install."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from lab.extras import EXTRAS as LAB_EXTRAS
from taichi_soft.core.extras import EXTRAS
from taichi_soft.render.demos import demo_names

ROOT = Path(__file__).resolve().parents[1]
PAGES = [(ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/first-steps.md")]
FOLLOWED = {"demo", "docs", "gallery"}
TESTS = {"test", "test-all"}
"""Targets of make that run this file."""

OPTIONAL = {module for modules in (*EXTRAS.values(), *LAB_EXTRAS.values()) for module in modules}
ABSENT = sorted(OPTIONAL - {*EXTRAS["cli"], *EXTRAS["film"]})

HIDING = f"""
from importlib.machinery import PathFinder

found = PathFinder.find_spec

@staticmethod
def find_spec(name, path=None, target=None):
    return None if name.partition(".")[0] in {ABSENT!r} else found(name, path, target)

PathFinder.find_spec = find_spec
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Runs a command in a copy of all files of the repository, whose environment is `make`'s after the setup.

    Its `python` finds the packages of the extras `cli` and `film`, and its `mkdocs` those of `docs`.
    """
    clone, hidden = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("hidden")
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    for name in names:
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_file():
            shutil.copyfile(ROOT / name, clone / name)
    (hidden / "sitecustomize.py").write_text(HIDING)
    programs = clone / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name, path, module in (
        ("python", f"{hidden}:{clone}", ""),
        ("taichi-soft", f"{hidden}:{clone}", "-m taichi_soft"),
        ("mkdocs", clone, "-m mkdocs"),
    ):
        (programs / name).write_text(
            f'#!/bin/sh\nPYTHONPATH="{path}" exec "{sys.executable}" {module} "$@"\n'
        )
        (programs / name).chmod(0o755)
    for extra in ("demo", "docs"):
        (clone / ".venv" / f".{extra}").touch()  # the setup is done: tests/test_setup.py

    def run(*command):
        done = subprocess.run(command, cwd=clone, capture_output=True, text=True, timeout=900)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "Traceback" not in done.stderr
        return done.stdout

    run.folder = clone
    return run


def test_every_target_of_make_that_the_first_pages_name_is_followed_here_or_runs_this():
    named = {
        name for text in PAGES for name in re.findall(r"^ +make ([\w-]+)|`make ([\w-]+)`", text, re.MULTILINE)
    }
    assert {one or other for one, other in named} <= FOLLOWED | TESTS


@pytest.mark.soak
def test_the_first_films_are_there(run):
    run("make", "demo")
    film = cv2.VideoCapture(str(run.folder / "out" / "bounce.mp4"))
    assert int(film.get(cv2.CAP_PROP_FRAME_COUNT)) == 250
    (command,) = re.findall(r"^ {4}taichi-soft (.*)$", PAGES[1], re.MULTILINE)
    program = run.folder / ".venv" / "bin" / "taichi-soft"
    run(str(program), *command.split(), "--seconds", "0.2", "--size", "128x96")
    assert (run.folder / "bounce.mp4").stat().st_size > 0


@pytest.mark.soak
def test_the_documentation_shows_a_still_of_every_demo(run):
    pytest.importorskip("mkdocs", reason="needs mkdocs-material: pip install 'taichi-soft[docs]'")
    run("make", "docs")
    site = run.folder / "out" / "docs"
    text = (site / "gallery.html").read_text(encoding="utf-8")
    shown = re.findall(r'<img class="film" src="([^"]+)"', text)
    assert [Path(each).stem for each in shown if "/demos/" in each] == demo_names()
    assert len(shown) == len(demo_names()) + 7  # worlds to play
    assert all((site / each).is_file() for each in shown)
    assert "make gallery" in text


@pytest.mark.soak
def test_the_gallery_films_every_demo_with_the_extras_of_the_first_page(run):
    said = run("make", "gallery", "GALLERY=--seconds 0.1 --size 96x54")
    made = re.findall(r"^(\w+): \d+ kB$", said, re.MULTILINE)
    assert made == demo_names()
    assert "skipped" not in said.replace("playable worlds: skipped", "")  # which need another extra
    for name in demo_names():
        assert (run.folder / "docs" / "gallery" / f"{name}.webm").stat().st_size > 0
