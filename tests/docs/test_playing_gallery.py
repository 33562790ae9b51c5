"""The worlds of the gallery in a browser, played by mouse, touch and keys, agree with Python bit by bit."""

import json
import re
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from browser import chromium, opened, pixels_of

from taichi_soft.core.extras import missing_packages

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("jelly", "hand")
SIZES = {1280: 800, 768: 1024, 400: 860}

sys.path.insert(0, str(ROOT / "docs"))

import gallery_hooks  # noqa: E402

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Address of a plain folder with two scenes, served by `python -m http.server`."""
    if missing_packages("export"):
        pytest.skip("needs the extra export")
    folder = tmp_path_factory.mktemp("site")
    worlds = folder / "gallery" / "play"
    command = [sys.executable, str(ROOT / "docs" / "make_worlds.py"), *NAMES, "--out", str(worlds)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    if "skipped" in done.stdout:
        pytest.skip(done.stdout)
    shutil.copytree(ROOT / "docs" / "pictures" / "play", folder / "pictures" / "play")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(gallery_hooks, "WORLDS", worlds)
        head = '<!DOCTYPE html><title>Gallery</title><link rel="icon" href="data:,">'
        (folder / "gallery.html").write_text(head + gallery_hooks.played())
    server = subprocess.Popen(
        [sys.executable, "-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    port = server.stdout.readline().split(" port ")[1].split()[0]
    yield f"http://127.0.0.1:{port}"
    server.terminate()
    server.wait()


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


def playing(browser, site, name="jelly", **options):
    """A page with a scene that is there."""
    page, complaints, requests = opened(browser, f"{site}/gallery/play/index.html#{name}", **options)
    page.locator("#words").wait_for(state="hidden")
    return page, complaints, requests


def steps_of(page):
    return int(page.locator("#steps").inner_text())


def pause(page):
    page.get_by_role("button", name="Pause").click()
    return page.locator("#hash").inner_text()


def saved(page, folder):
    """The file that the page gives, and what was called in it."""
    with page.expect_download() as given:
        page.get_by_role("button", name="Save what I did").click()
    file = folder / given.value.suggested_filename
    given.value.save_as(file)
    calls = [entry[2] for entry in json.loads(file.read_text())["entries"] if entry[0] == "call"]
    return file, calls


def middle_of(page):
    """A place in the picture where the jelly is."""
    box = page.locator("#view").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + 0.6 * box["height"]


def drag(page, is_touch):
    """Pull what is in the middle, and hold it for a moment."""
    x, y = middle_of(page)
    if is_touch:
        fingers = page.context.new_cdp_session(page)
        fingers.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        for i in range(4):
            moved = {"type": "touchMove", "touchPoints": [{"x": x + 20 * i, "y": y - 20 * i}]}
            fingers.send("Input.dispatchTouchEvent", moved)
            page.wait_for_timeout(150)
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        return
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y - 60, steps=4)
    page.wait_for_timeout(500)
    page.mouse.up()


def replayed(file):
    """Return the output of the command that replays a file."""
    picture = file.with_suffix(".png")
    command = [sys.executable, "-m", "taichi_soft", "replay", str(file), "--out", str(picture)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "all states are bit-identical" in done.stdout
    return done.stdout


@pytest.mark.parametrize(("width", "height"), SIZES.items())
def test_a_jelly_is_pulled_set_and_reset_and_python_has_the_same_bits(browser, site, tmp_path, width, height):
    is_touch = width == 400
    options = {"viewport": {"width": width, "height": height}, "has_touch": is_touch, "is_mobile": is_touch}
    page, complaints, requests = opened(browser, f"{site}/gallery.html", **options)
    page.get_by_role("link", name="Play: Pull a jelly").click()
    page.locator("#words").wait_for(state="hidden")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("#view").bounding_box()["height"] > 0.35 * height

    drag(page, is_touch)
    slider = page.get_by_role("slider", name="Gravity")
    slider.press("ArrowRight")
    slider.press("ArrowRight")
    assert slider.get_attribute("aria-valuetext") == "1.2 g"
    page.get_by_role("button", name="Drop a berry").click()
    page.get_by_role("button", name="Poke").click()
    page.wait_for_timeout(500)
    shown = pause(page)
    count = steps_of(page)
    file, calls = saved(page, tmp_path)
    assert {"grab", "move", "release", "set_gravity_scale", "spawn", "apply_impulse_at_point"} <= set(calls)
    assert f"prints {shown}" in page.locator("#verdict").inner_text()

    page.get_by_role("button", name="Reset").click()
    assert steps_of(page) == 0
    assert slider.input_value() == "1"
    page.locator("#view").press("Space")
    page.wait_for_function("Number(document.querySelector('#steps').textContent) > 3")
    assert complaints == []
    assert all(address.startswith((site, "data:", "blob:")) for address in requests)
    page.close()
    if width == 1280:  # Python's part is the same for each
        said = replayed(file)
        assert f"up to step {count}" in said
        assert f"hash {shown}" in said


SLOW = """() => {
  const quick = window.fetch;
  window.fetch = async (...given) => {
    const answer = await quick(...given);
    await new Promise((done) => setTimeout(done, 500));
    return answer;
  };
}"""


def test_a_world_that_goes_on_while_it_is_saved_has_the_hash_of_its_file(browser, site, tmp_path):
    page, complaints, _ = playing(browser, site)
    page.evaluate(SLOW)
    count = steps_of(page)
    file, _ = saved(page, tmp_path)
    page.get_by_text("On a PC, taichi-soft replay").wait_for()
    steps = [entry for entry in json.loads(file.read_text())["entries"] if entry[0] == "step"]
    assert len(steps) > count + 10
    assert f"prints {steps[-1][3]}." in page.locator("#verdict").inner_text()
    page.route("**/*.recording", lambda route: route.abort())
    page.get_by_role("button", name="Save what I did").click()
    page.get_by_text("cannot be saved, because jelly.recording cannot be read").wait_for()
    assert complaints == ["Failed to load resource: net::ERR_FAILED"]
    page.close()


LONG = """
import { Game } from "./game.mjs";
let state = 0;
const world = {
  snapshot: () => 0,
  restore: () => (state = 0),
  step: () => (state += 1),
  hash: () => `state ${state}`,
};
const facts = { handles: { body: [], next: 1 }, controls: [], dt: 1 / 60 };
const game = new Game({ createWorld: () => world }, facts);
const found = [];
for (let i = 0; i <= 36_002; i += 1) {
  if (i === 10 || i > 35_999) found.push([game.hash, game.recordedHash, game.entries.at(-1)[3]]);
  game.step();
}
console.log(JSON.stringify(found));
"""


def test_a_file_of_ten_minutes_ends_with_the_hash_of_their_last_step(tmp_path):
    if shutil.which("node") is None:
        pytest.skip("needs node: apt-get install nodejs")
    shutil.copy(ROOT / "docs" / "play" / "game.js", tmp_path / "game.mjs")
    (tmp_path / "long.mjs").write_text(LONG)
    done = subprocess.run(["node", tmp_path / "long.mjs"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    end = "state 36000"
    wanted = [["state 10"] * 3, [end] * 3, ["state 36001", end, end], ["state 36002", end, end]]
    assert json.loads(done.stdout) == wanted


@pytest.mark.guard
def test_untouched_scenes_have_the_hash_of_python_and_the_back_button_leads_to_the_first(
    browser, site, tmp_path
):
    page, complaints, _ = playing(browser, site)
    for title in ("Pull a jelly", "Swing and twist"):
        page.get_by_role("link", name=title).click()
        page.get_by_role("heading", name=title).wait_for()
        page.locator("#words").wait_for(state="hidden")
        page.get_by_role("button", name="Compare with a PC").click()
        verdict = page.get_by_text("Step 300 has the hash")
        verdict.wait_for()
        assert "the same as on the PC" in verdict.inner_text()
    shown = page.locator("#hash").inner_text()
    recording = tmp_path / "hand.recording"
    with urllib.request.urlopen(f"{site}/gallery/play/hand/hand.recording") as answer:
        recording.write_bytes(answer.read())
    assert f"hash {shown}" in replayed(recording)
    page.get_by_role("slider", name="Turn").press("PageUp")
    page.get_by_role("slider", name="Move").press("End")
    page.get_by_role("button", name="Play", exact=True).click()
    page.wait_for_timeout(1500)
    shown = pause(page)
    file, calls = saved(page, tmp_path)
    assert calls.count("move_to") > 10
    assert f"hash {shown}" in replayed(file)

    page.go_back()
    page.get_by_role("heading", name="Pull a jelly").wait_for()
    page.locator("#words").wait_for(state="hidden")
    page.wait_for_function("Number(document.querySelector('#steps').textContent) > 3")
    assert page.get_by_role("slider", name="Turn").count() == 0
    assert complaints == []
    page.close()


HIDE = """(hidden) => {
  Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""


def test_a_hidden_tab_stands_still_and_goes_on_from_there(browser, site, tmp_path):
    """And a held body is released there, and where the window loses its focus or the pointer is cancelled."""
    page, complaints, _ = playing(browser, site, viewport={"width": 800, "height": 600})
    page.evaluate(HIDE, True)
    page.wait_for_timeout(400)
    before = steps_of(page)
    page.wait_for_timeout(1500)
    assert steps_of(page) == before
    page.evaluate(HIDE, False)
    page.wait_for_function(f"Number(document.querySelector('#steps').textContent) > {before}")
    assert steps_of(page) < before + 60  # and not the 90 or more steps that were due

    x, y = middle_of(page)
    cancel = (
        "document.querySelector('#view').dispatchEvent(new PointerEvent('pointercancel', {pointerId: 1}))"
    )
    for lose in ("window.dispatchEvent(new Event('blur'))", cancel, f"({HIDE})(true), ({HIDE})(false)"):
        page.mouse.move(x, y)
        page.mouse.down()
        page.wait_for_timeout(300)
        page.evaluate(lose)
        page.mouse.move(x + 60, y - 60, steps=2)
        page.wait_for_timeout(200)
        page.mouse.up()
    _, calls = saved(page, tmp_path)
    assert calls == 3 * ["grab", "move", "release"]  # the body no longer follows the pointer
    assert complaints == []
    page.close()


def test_who_wants_no_motion_has_a_still_until_they_press_play(browser, site):
    page, complaints, _ = playing(
        browser, site, reduced_motion="reduce", viewport={"width": 640, "height": 480}
    )
    page.get_by_text("your system is set to reduce motion").wait_for()
    still = pixels_of(page, "#view")
    page.wait_for_timeout(1000)
    assert steps_of(page) == 0
    assert np.abs(pixels_of(page, "#view") - still).max() == 0
    assert len(np.unique(still.reshape(-1, 3), axis=0)) > 100  # a body in light and shadow
    page.locator("#view").press("ArrowLeft")
    page.wait_for_timeout(500)
    assert np.abs(pixels_of(page, "#view") - still).mean() > 0.5
    page.get_by_role("button", name="Play", exact=True).click()
    page.wait_for_function("Number(document.querySelector('#steps').textContent) > 3")
    assert complaints == []
    page.close()


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("WebAssembly.validate = () => false", "WebAssembly has no SIMD"),
        ("delete globalThis.WebAssembly", "has no WebAssembly"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "no WebGL, which the page needs"),
        (
            "WebAssembly.compile = async () => { throw new Error('broken') }",
            "cannot be opened: .*SIMD: broken",
        ),
    ],
)
def test_a_browser_that_cannot_play_says_why_over_a_still(browser, site, broken, said):
    page = browser.new_page()
    page.add_init_script(broken)
    page.goto(f"{site}/gallery/play/index.html#hand")
    words = page.locator("#words")
    page.wait_for_function("document.querySelector('#words').textContent.length > 20")
    assert re.search(said, words.inner_text())
    assert "pictures/play/hand.jpg" in words.evaluate("(each) => getComputedStyle(each).backgroundImage")
    page.close()
