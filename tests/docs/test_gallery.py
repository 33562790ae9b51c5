"""The gallery: an entry for each demo and scene, and films that a browser can play."""

import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from browser import chromium, opened

from engine_adapter import FixedStep
from taichi_soft import (
    BoxShape,
    Material,
    MissingExtraError,
    box,
)
from taichi_soft.core.package_data import DEMOS
from taichi_soft.render import Camera, VideoWriter
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.film import Actor, Stage
from taichi_soft.world.bare import bare_world

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

import gallery_hooks  # noqa: E402
import make_gallery  # noqa: E402

DT = 1 / 50
RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.2, 0.9)


def falling_stage():
    """A red box falls beside a blue slab that moves and turns; below is a slab that does neither."""
    world = bare_world(floor=-0.5)
    body = world.add_body(box((0.6, 0.5, 0.4), (2, 2, 2)), Material(1e5, 0.2, 1000.0), position=(0, 0, 2.5))
    mover = world.add_collider(BoxShape((0.3, 0.4, 0.5)), position=(1.2, 0.0, 0.5))
    world.add_collider(BoxShape((4.0, 2.0, 0.2)), position=(0.3, 0.0, -0.4))
    world.build()
    camera = Camera.framing((-1.2, -0.5, -0.4), (1.8, 0.5, 3.0), aspect=16 / 9, azimuth=-80, elevation=10)

    def act(world):
        angle = 0.5 * (world.time + DT)
        turn = [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        mover.move_to((1.2, 0.0, 0.5 + 0.4 * angle), turn)

    actors = [Actor(body, RED, shift=(0.1, 0.0, 0.0))]
    return Stage("a box", world, actors, camera, FixedStep(DT), 0.6, act, collider_colors={mover: BLUE})


class Films(HTMLParser):
    """The attributes of every element, by its name."""

    def __init__(self, html):
        super().__init__()
        self.found = {}
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.found.setdefault(tag, []).append(dict(attrs))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Empty files for the films of all demos."""
    made = tmp_path / "gallery"
    made.mkdir()
    for name in demo_names():
        (made / f"{name}.webm").touch()
    monkeypatch.setattr(gallery_hooks, "FOLDER", made)
    monkeypatch.setattr(gallery_hooks, "WORLDS", made / "play")
    return made


def test_every_demo_has_an_entry_with_film_still_words_script_and_command(folder):
    entries = gallery_hooks.entries().split('<section class="demo"')[1:]
    assert len(entries) == len(demo_names())
    for name, entry in zip(demo_names(), entries, strict=True):
        found = Films(entry).found
        (film,), (source,), (still,) = found["video"], found["source"], found["img"]
        summary, _, notice = load_demo(name).__doc__.strip().partition("\n\n")
        summary, notice = (" ".join(text.split()) for text in (summary, notice))
        assert source["src"] == f"gallery/{name}.webm"
        assert film["poster"] == still["src"] == f"pictures/demos/{name}.jpg"
        assert {"loop", "muted", "playsinline", "controls"} <= set(film)
        assert "autoplay" not in film  # gallery.js starts the film unless the reader prefers reduced motion
        assert still["alt"] == summary
        assert summary in film["aria-label"]
        assert f"\n{summary}\n" in entry
        assert f"**What to notice:** {notice}\n" in entry
        assert len(notice) > 20
        assert f"[Script](demos/{name}.md)" in entry
        assert f"`taichi-soft demo {name}`" in entry
    assert "make gallery" not in gallery_hooks.entries()


def test_without_films_the_gallery_shows_stills_and_says_how_to_make_films(folder):
    (folder / "cut.webm").unlink()
    text = gallery_hooks.entries()
    assert "without some of its films. `make gallery`" in text
    assert len(Films(text).found["video"]) == len(demo_names()) - 1
    shutil.rmtree(folder)
    text = gallery_hooks.entries()
    assert "without its films. `make gallery`" in text
    stills = Films(text).found["img"]
    assert [still["src"] for still in stills] == [f"pictures/demos/{name}.jpg" for name in demo_names()]
    assert "video" not in Films(text).found
    assert "demos/cut.md" in text


def test_a_scene_to_play_leads_to_its_page_where_that_was_made(folder):
    scenes = gallery_hooks.scenes()
    assert len(scenes) >= 6
    assert all(each.title and each.what for each in scenes)
    text = gallery_hooks.played()
    assert "a" not in Films(text).found
    assert "without its worlds. `make gallery`" in text
    for each in scenes:
        (folder / "play" / each.name).mkdir(parents=True)
        (folder / "play" / each.name / "scene.json").touch()
    text = gallery_hooks.played()
    found = Films(text).found
    assert [each["href"] for each in found["a"]] == [
        f"gallery/play/index.html#{each.name}" for each in scenes
    ]
    assert [each["src"] for each in found["img"]] == [f"pictures/play/{each.name}.jpg" for each in scenes]
    assert "make gallery" not in text


STILLS = [f"demos/{name}" for name in demo_names()] + [f"play/{each.name}" for each in gallery_hooks.scenes()]


@pytest.mark.parametrize("name", STILLS)
def test_every_demo_and_scene_has_a_still_in_the_repository(name):
    """`python docs/make_pictures.py` makes them."""
    file = ROOT / "docs" / "pictures" / f"{name}.jpg"
    assert cv2.imread(str(file)).shape == (270, 480, 3)
    assert file.stat().st_size < 40_000


def test_the_page_of_a_script_holds_it_as_it_is():
    """The code of the page, run through nothing."""
    (demo,) = [each for each in gallery_hooks.demos() if each.name == "jelly"]
    text = gallery_hooks.SCRIPT.format(name=demo.name, what=demo.what, script=demo.script.strip())
    code = text.split("```python\n")[1].split("\n```")[0]
    assert code == (DEMOS / "jelly.py").read_text(encoding="utf-8").strip()


def test_a_demo_without_a_word_on_what_to_notice_is_refused(tmp_path):
    (tmp_path / "new.py").write_text('"""One sentence."""\n\ndef stage():\n    ...\n')
    with pytest.raises(ValueError, match=r"new\.py.*second paragraph"):
        gallery_hooks.Demo.of(tmp_path / "new.py")


@pytest.mark.soak
def test_a_film_of_the_gallery_ends_where_it_begins(tmp_path, monkeypatch):
    """Its last picture is nearer to its first one than the one before the fade is."""
    monkeypatch.setattr(make_gallery, "FOLDER", tmp_path)
    seen = []
    make_gallery.write_film(falling_stage(), "box", lambda *now: seen.append(now))
    film = cv2.VideoCapture(str(tmp_path / "box.webm"))
    pictures = []
    while True:
        is_there, picture = film.read()
        if not is_there:
            break
        pictures.append(picture.astype(int))
    assert seen[-1] == (15, 15)
    assert len(pictures) == 15 + make_gallery.FADE
    assert pictures[0].shape == (270, 480, 3)
    gaps = [np.abs(picture - pictures[0]).mean() for picture in (pictures[-1], pictures[14])]
    assert gaps[0] < 0.5 * gaps[1]


@pytest.mark.soak
def test_a_demo_that_needs_a_missing_package_is_skipped_by_name(tmp_path, monkeypatch, capsys):
    def load(name):
        if name == "rich":
            raise MissingExtraError("riches need gold, not installed here")
        return SimpleNamespace(stage=falling_stage)

    monkeypatch.setattr(make_gallery, "FOLDER", tmp_path)
    monkeypatch.setattr(make_gallery, "load_demo", load)
    monkeypatch.setattr(
        sys, "argv", ["make_gallery.py", "rich", "box", "--seconds", "0.1", "--size", "96x54"]
    )
    make_gallery.main()
    lines = capsys.readouterr().out.splitlines()
    assert lines[:3] == [
        "filming rich, 1 of 2",
        "rich: skipped. riches need gold, not installed here",
        "filming box, 2 of 2",
    ]
    assert lines[3].startswith("box: ")
    film = cv2.VideoCapture(str(tmp_path / "box.webm"))
    assert int(film.get(cv2.CAP_PROP_FRAME_COUNT)) == 2 + make_gallery.FADE
    assert film.get(cv2.CAP_PROP_FRAME_WIDTH) == 96


@pytest.mark.soak
@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_films_of_the_gallery_play_in_view_unless_no_motion_is_wanted(folder, motion):
    film = folder / "attach.webm"
    with VideoWriter(film, fps=25, size=(480, 270)) as writer:
        for shade in range(0, 250, 5):
            writer.write(np.full((270, 480, 3), shade, np.uint8))
    for name in demo_names()[1:]:
        shutil.copy(film, folder / f"{name}.webm")
    shutil.copytree(ROOT / "docs" / "theme", folder.parent / "theme")
    page_file = folder.parent / "gallery.html"
    page_file.write_text(f"<!DOCTYPE html><body>{gallery_hooks.entries()}")
    playing = "[...document.querySelectorAll('video')].filter((each) => !each.paused).length"
    with chromium() as browser:
        page, _, _ = opened(browser, page_file.as_uri(), reduced_motion=motion)
        button = page.locator("#films")
        button.wait_for()
        if motion == "reduce":
            page.wait_for_timeout(1000)
            assert page.evaluate(playing) == 0
            its = page.get_by_role("button", name="Play: Film: A soft bar")
            its.click()
            page.wait_for_function(f"{playing} === 1")
            page.get_by_role("button", name="Pause: Film: A soft bar").click()
            page.wait_for_function(f"{playing} === 0")
            button.click()
        page.wait_for_function(f"{playing} > 0")
        assert page.evaluate(playing) < len(demo_names()) / 2  # those in view
        assert button.text_content() == "Pause all films"
        button.click()
        page.wait_for_function(f"{playing} === 0")
        assert button.text_content() == "Play films in view"
