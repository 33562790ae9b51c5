"""The gallery: an entry for each demo, motions that hold what the world did, pages that work in a browser."""

import gzip
import json
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from browser import chromium, opened, pixels_of

from engine_adapter import FixedStep
from taichi_soft import BoxShape, Material, SpringMaterial, World, box, cloth, cloth_constants
from taichi_soft.core.package_data import DEMOS
from taichi_soft.render import Camera, VideoWriter
from taichi_soft.render.demos import demo_names, load_demo
from taichi_soft.render.film import Actor, Stage

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))

import gallery_hooks  # noqa: E402
import make_gallery  # noqa: E402
from viewer.motion import motion_of  # noqa: E402
from viewer.page import write_page  # noqa: E402

DT = 1 / 50
RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.2, 0.9)


def falling_stage():
    """A red box falls beside a blue slab that moves and turns; below is a slab that does neither."""
    world = World(floor=-0.5)
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


def hanging_stage():
    """A cloth that hangs from two corners: both of its sides are drawn."""
    mesh = cloth((1.0, 1.0), (6, 6), 0.2)
    world = World(integrator="implicit_euler", floor=None)
    material = SpringMaterial(
        cloth_constants(mesh, (6, 6), tensile=400.0, shear=150.0, bend=3.0), damping=0.05
    )
    world.add_body(mesh, material, law="springs", pinned=[0, 6], position=(0.5, 0.0, 2.0))
    world.build()
    camera = Camera.framing((-0.5, -0.6, 0.8), (1.1, 0.6, 2.2), aspect=16 / 9)
    return Stage("a cloth", world, [Actor(world.bodies[0], BLUE)], camera, FixedStep(1 / 60, 1), 0.5)


def decoded(motion):
    """The header, and of each part its triangles (m, 3) of points and its places (frames, points, 3)."""
    raw = gzip.decompress(motion)
    begin = 4 + int.from_bytes(raw[:4], "little")
    header = json.loads(raw[4:begin])
    low, high = np.frombuffer(raw[begin:], np.uint8).reshape(2, -1).astype(np.int64)
    numbers = iter(np.split(low + 256 * high, np.cumsum(list(counts_of(header)))))
    corners = []
    for _ in header["parts"]:
        points = next(numbers)
        corners.append(points[next(numbers)].reshape(-1, 3))
    still = [next(numbers).reshape(1, 3, -1) for part in header["parts"] if not part["moves"]]
    track = next(numbers).reshape(header["frames"], 3, -1)
    steps = np.cumsum(track[1:], axis=0)
    track = np.cumsum(np.concatenate([track[:1], steps]), axis=0) % 65536
    ends = np.cumsum([part["points"] for part in header["parts"] if part["moves"]])
    moving = iter(np.split(track, ends, axis=2))
    still = iter(still)
    places = []
    for part in header["parts"]:
        whole = next(moving) if part["moves"] else np.repeat(next(still), header["frames"], axis=0)
        places.append(np.array(header["lower"]) + header["quantum"] * whole.transpose(0, 2, 1))
    return header, corners, places


def counts_of(header):
    """How many numbers there are of each kind, but the last."""
    for part in header["parts"]:
        yield from (part["vertices"], 3 * part["triangles"])
    yield from (3 * part["points"] for part in header["parts"] if not part["moves"])


def test_a_motion_holds_the_places_of_all_vertices_within_half_a_quantum():
    """Those that the world has, stepped by itself here; of colliders by their sizes and where they are."""
    header, corners, places = decoded(motion_of(falling_stage()))
    assert header["fps"] == 25.0
    assert header["frames"] == 16
    assert header["floor"] == -0.5
    assert [part["moves"] for part in header["parts"]] == [True, True, False]
    np.testing.assert_allclose([part["color"] for part in header["parts"][:2]], [RED, BLUE], atol=2e-3)
    stage = falling_stage()
    body, mover = stage.actors[0].body, stage.world.colliders[0]
    slack = header["quantum"] / 2 + 1e-6
    ends = np.array(np.meshgrid(*3 * [[-0.5, 0.5]], indexing="ij")).reshape(3, -1).T
    for frame in range(header["frames"]):
        rows = body.positions() + np.array([0.1, 0.0, 0.0])
        np.testing.assert_allclose(places[0][frame][corners[0]], rows[body.mesh.surface], atol=slack)
        turned = ends * (0.3, 0.4, 0.5) @ np.array(mover.rotation).T + mover.position
        for found, wanted in ((places[1], turned), (places[2], ends * (4.0, 2.0, 0.2) + (0.3, 0, -0.4))):
            gaps = np.abs(found[frame][:, None] - wanted).max(axis=2)
            assert gaps.shape == (8, 8)
            assert gaps.min(axis=0).max() < slack
        for _ in range(2):
            stage.act(stage.world)
            stage.world.step(DT)


def test_a_motion_of_a_cloth_has_both_of_its_sides_and_each_place_once():
    header, corners, places = decoded(motion_of(hanging_stage()))
    assert header["fps"] == pytest.approx(30.0)
    assert header["floor"] is None
    stage = hanging_stage()
    body = stage.actors[0].body
    assert header["parts"][0]["points"] == len(body.positions()) == 49
    for frame in range(header["frames"]):
        rows = body.positions()[body.mesh.surface]
        np.testing.assert_allclose(places[0][frame][corners[0]], rows, atol=header["quantum"] / 2 + 1e-6)
        for _ in range(2):
            stage.world.step(1 / 60, 1)


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
    """Films and stills for all demos, none of which is true."""
    made = tmp_path / "gallery"
    made.mkdir()
    for name in demo_names():
        (made / f"{name}.webm").touch()
        (made / f"{name}.jpg").touch()
    monkeypatch.setattr(gallery_hooks, "FOLDER", made)
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
        assert film["poster"] == still["src"] == f"gallery/{name}.jpg"
        assert {"loop", "muted", "playsinline", "controls"} <= set(film)
        assert "autoplay" not in film  # gallery.js starts it, where motion is wanted
        assert still["alt"] == summary
        assert summary in film["aria-label"]
        assert f"\n{summary}\n" in entry
        assert f"**What to notice:** {notice}\n" in entry
        assert len(notice) > 20
        assert f"[Script](demos/{name}.md)" in entry
        assert f"`taichi-soft demo {name}`" in entry
    assert "make gallery" not in gallery_hooks.entries()


def test_the_page_says_how_to_make_what_is_missing(folder):
    assert "make gallery" in gallery_hooks.viewer()
    (folder / "viewer.html").write_text("x" * 2_300_000)
    (folder / "jelly.motion").touch()
    assert "2.3 MB" in gallery_hooks.viewer()
    assert "gallery/viewer.html#jelly" in gallery_hooks.entries()
    (folder / "cut.webm").unlink()
    text = gallery_hooks.entries()
    assert "make gallery" in text
    assert len(Films(text).found["video"]) == len(demo_names()) - 1
    assert "demos/cut.md" in text


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


def test_a_film_of_the_gallery_ends_where_it_begins(tmp_path, monkeypatch):
    """Its last picture is nearer to its first one than the one before the fade is."""
    import cv2

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
    assert cv2.imread(str(tmp_path / "box.jpg")).shape == (270, 480, 3)


@pytest.mark.parametrize("name", make_gallery.TURNABLE)
def test_the_motion_of_a_demo_is_less_than_a_megabyte(name):
    assert len(motion_of(load_demo(name).stage())) < 1e6


@pytest.fixture(scope="module")
def turned_page(tmp_path_factory):
    """The page with two small motions."""
    path = tmp_path_factory.mktemp("page") / "viewer.html"
    motions = {"box": motion_of(falling_stage()), "cloth": motion_of(hanging_stage())}
    try:
        write_page(path, motions)
    except OSError as error:
        pytest.skip(f"needs registry.npmjs.org: {error}")
    return path.as_uri()


def ready(browser, address, **options):
    """The page, once it has drawn."""
    options = {"viewport": {"width": 960, "height": 700}, **options}
    page, complaints, requests = opened(browser, address, **options)
    page.wait_for_function("document.querySelector('#told').textContent !== ''")
    return page, complaints, requests


def reach(page, text):
    """Wait until the page tells a time."""
    page.wait_for_function(f"document.querySelector('#told').textContent.startsWith('{text}')")


def change(page, act):
    """By how much the picture changes through what is done, mean of levels from 0 to 255."""
    before = pixels_of(page, "#view")
    act()
    page.wait_for_timeout(500)
    return np.abs(pixels_of(page, "#view") - before).mean()


def test_the_page_plays_scrubs_and_turns_by_keys_from_a_file(turned_page):
    """Without asking for anything, and without a complaint."""
    with chromium() as browser:
        page, complaints, requests = ready(browser, turned_page, reduced_motion="reduce")
        assert page.locator("#told").text_content() == "0.00 of 0.60 s"
        assert change(page, lambda: None) == 0.0  # who wants no motion has none
        still = pixels_of(page, "#view")

        slider = page.get_by_role("slider", name="Time")
        slider.focus()
        slider.press("ArrowRight")
        reach(page, "0.04")
        assert change(page, lambda: (slider.press("End"), reach(page, "0.60"))) > 0.5
        assert slider.get_attribute("aria-valuetext") == "0.60 seconds"

        view = page.get_by_role("application")
        view.focus()
        assert change(page, lambda: view.press("ArrowLeft")) > 0.5
        assert change(page, lambda: view.press("-")) > 0.5
        view.press(",")
        reach(page, "0.56")
        view.press(".")
        reach(page, "0.60")
        slider.press("Home")
        reach(page, "0.00")
        page.get_by_role("button", name="First view").click()
        page.wait_for_timeout(500)
        np.testing.assert_allclose(pixels_of(page, "#view"), still, atol=2)

        page.get_by_role("combobox", name="Speed").select_option("1/10")
        view.press(" ")
        page.wait_for_function("!document.querySelector('#told').textContent.startsWith('0.00')")
        page.get_by_role("button", name="Pause").click()
        assert page.get_by_role("button", name="Play").is_visible()
        assert np.abs(pixels_of(page, "#view") - still).mean() > 0.01

        page.get_by_role("radio", name="cloth").check()
        page.wait_for_function("document.querySelector('#told').textContent.endsWith('of 0.50 s')")
        assert "a cloth" in view.get_attribute("aria-label")
        assert complaints == []
        assert {url.partition(":")[0] for url in requests} <= {"file", "blob", "data"}


def test_the_page_plays_by_itself_where_motion_is_wanted(turned_page):
    with chromium() as browser:
        page, complaints, _ = ready(browser, f"{turned_page}#cloth", reduced_motion="no-preference")
        assert page.get_by_role("radio", name="cloth").is_checked()
        times = set()
        page.wait_for_function("document.querySelector('#time').value > 0")
        for _ in range(4):
            times.add(page.locator("#told").text_content())
            page.wait_for_timeout(300)
        assert len(times) > 1
        assert complaints == []


def test_a_browser_that_cannot_draw_says_so(turned_page):
    with chromium("--disable-3d-apis") as browser:
        page, _, _ = opened(browser, turned_page)
        page.get_by_text("This browser cannot show the bodies").wait_for()


def test_a_body_is_drawn_where_the_camera_of_its_stage_sees_it(turned_page):
    """Its red pixels lie about the place to which its middle is projected here."""
    header, _, places = decoded(motion_of(falling_stage()))
    with chromium() as browser:
        page, _, _ = ready(browser, turned_page, reduced_motion="reduce")
        for frame in (0, 12):
            page.get_by_role("slider").fill(str(frame))
            reach(page, f"{frame / 25:.2f}")
            page.wait_for_timeout(500)
            pixels = pixels_of(page, "#view")
            red, green, blue = np.moveaxis(pixels, 2, 0)
            found = np.argwhere((red > 2 * green) & (red > 2 * blue) & (red > 60))
            camera = falling_stage().camera
            wanted = camera.project(places[0][frame].mean(axis=0)[None], pixels.shape[1], pixels.shape[0])
            assert len(found) > 300
            np.testing.assert_allclose(found.mean(axis=0)[::-1], wanted[0, :2], atol=8)
        assert header["frames"] > 12


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (360, 640)])
def test_every_control_of_the_page_has_a_name_and_is_in_view(turned_page, width, height):
    with chromium() as browser:
        page, _, _ = ready(browser, turned_page, viewport={"width": width, "height": height})
        tree = page.context.new_cdp_session(page).send("Accessibility.getFullAXTree")["nodes"]
        roles = ("application", "button", "slider", "combobox", "radio")
        named = {}
        for node in tree:
            role = node.get("role", {}).get("value")
            if role in roles and not node["ignored"]:
                named.setdefault(role, []).append(node.get("name", {}).get("value", ""))
        assert {role: len(names) for role, names in named.items()} == {
            **{"application": 1, "button": 2, "slider": 1, "combobox": 1},
            "radio": 2,
        }
        assert all(name for names in named.values() for name in names)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for selector in ("#play", "#time", "#speed", "#reset", "#view", "#demos"):
            place = page.locator(selector).bounding_box()
            assert place["x"] >= 0
            assert place["y"] >= 0
            assert place["x"] + place["width"] <= width
            assert place["y"] + place["height"] <= height
        assert page.locator("#view").bounding_box()["height"] > 0.35 * height


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
