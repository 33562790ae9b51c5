"""The page in a browser: its display, its mouse and keyboard input, and its texts for screen readers."""

import functools
import io
import re
import threading
import zipfile
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import PATIENCE, chromium, launched
from visitor import Visitor

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")
PIL = pytest.importorskip("PIL.Image", reason="needs pillow")

pytestmark = pytest.mark.soak


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture
def troubles():
    """Return the list of the pages' error messages. It should stay empty."""
    found = []
    yield found
    assert found == []


@pytest.fixture
def open_page(browser, served, troubles):
    """A function that opens the page in a window of a size, and waits for a picture."""
    opened = []

    def opened_at(width=1000, height=640, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        opened.append(context)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda m: troubles.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: troubles.append(str(error)))
        page.on("requestfailed", lambda request: troubles.append(request.url))
        page.goto(served.address)
        playwright.expect(page.locator("#time")).to_have_text(re.compile(r"\d s"), timeout=PATIENCE)
        playwright.expect(page.locator("#fps")).not_to_have_text("0", timeout=PATIENCE)
        return page

    yield opened_at
    for context in opened:
        context.close()


def picture_of(page):
    """Return the image of the canvas, uint8 (h, w, 3), and its position on the page."""
    box = page.locator("#view").bounding_box()
    shot = PIL.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB")
    return np.asarray(shot).astype(int), box


def coral(picture):
    """Return centre and number of the first body's pixels. Nothing else has its colour."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    rows, columns = np.nonzero((red > 1.7 * green) & (green > blue - 10) & (red > 120))
    return np.array([columns.mean(), rows.mean()]), len(rows)


def honey_count(picture):
    """Return the number of the third body's pixels. Nothing else and no scale has its colour."""
    red, green, blue = np.moveaxis(picture, 2, 0)
    return int(((red > 1.2 * green) & (green > 1.7 * blue)).sum())


OVERLAPS = """() => {
    const leaves = [...document.querySelectorAll("aside *")].filter(each =>
        (!each.children.length || each.matches("select")) && each.checkVisibility()
        && !each.closest("select *")
        && (each.textContent.trim() || each.matches("button, input, select, canvas")));
    const boxes = leaves.map(each => [each, each.getBoundingClientRect()]);
    const found = [];
    boxes.forEach(([a, p], i) => boxes.slice(i + 1).forEach(([b, q]) => {
        const wide = Math.min(p.right, q.right) - Math.max(p.left, q.left);
        const high = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
        if (wide > 1 && high > 2 && !a.contains(b) && !b.contains(a)) found.push([a.outerHTML, b.outerHTML]);
    }));
    return found;
}"""
"""Pairs of labels, values and controls that lie on each other."""


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1000, 640), (390, 844), (320, 568)])
def test_a_page_of_any_size_shows_bodies_and_controls_that_do_not_overlap(
    open_page, visitor, width, height, tmp_path
):
    is_phone = width < 500
    page = open_page(width, height, has_touch=is_phone)
    picture, box = picture_of(page)
    assert coral(picture)[1] > 100
    assert box["width"] >= 0.6 * width
    if is_phone:  # the panel is a sheet, which a tap opens
        assert not page.locator("#panel").is_visible()
        assert box["height"] >= 0.8 * height
        page.get_by_role("button", name="Show controls").tap()
        playwright.expect(page.get_by_role("button", name="Hide controls")).to_be_visible()
        assert page.locator("aside").bounding_box()["height"] <= height / 3 + 1
    # The longest that they get.
    for name, words in {
        "time": "123456 s",
        "step-ms": "1234.5 ms",
        "factor": "10.00 x",
        "late": "1234, 5678 ms",
    }.items():
        page.locator(f"#{name}").evaluate("(each, words) => { each.textContent = words; }", words)
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("aside").evaluate("each => each.scrollWidth - each.clientWidth") <= 0
    page.screenshot(path=tmp_path / "page.png")


def test_numbers_have_three_digits_and_si_prefixes_of_the_units_that_take_them(open_page, visitor):
    page = open_page()
    asked = {
        (1.59e9, "J"): "1.59 GJ",
        (999.6, "Pa"): "1 kPa",
        (12e3, "Pa"): "12 kPa",
        (0.0408, "J"): "40.8 mJ",
        (-1234.5, "J"): "-1.23 kJ",
        (3.2e-5, "N s"): "32 µN s",
        (1e-9, "J"): "0 J",
        (0.0, "Pa"): "0 Pa",
        (5e13, "J"): "50 TJ",
        (9.81, "m/s²"): "9.81 m/s²",
        (1500.0, "m/s"): "1500 m/s",
        (0.4, ""): "0.4",
        (None, "Pa"): "various",
    }
    spelled = page.evaluate(
        "rows => import('./quantity.js').then(({ quantity }) => rows.map(row => quantity(...row)))",
        [list(each) for each in asked],
    )
    assert dict(zip(asked, spelled, strict=True)) == asked


def test_all_bodies_are_framed_again_from_wherever_the_view_is(open_page, visitor):
    visitor.say("pause", is_paused=True)
    page = open_page()
    box = page.locator("#view").bounding_box()
    page.locator("#view").focus()
    for way in ("button", "key"):
        for _ in range(25):
            page.keyboard.press("-")
        page.wait_for_timeout(1500)
        assert coral(picture_of(page)[0])[1] < 60
        if way == "button":
            page.get_by_role("button", name="Frame all").click()
        else:
            page.keyboard.press("f")
        page.wait_for_timeout(1500)
        picture, _ = picture_of(page)
        (x, _), count = coral(picture)
        assert count > 400
        assert 0.1 * box["width"] < x < 0.9 * box["width"]
        page.locator("#view").focus()
    visitor.say("pause", is_paused=False)


def test_the_cursor_shows_what_can_be_grabbed_and_what_is_held(open_page, visitor):
    page = open_page()
    visitor.until(lambda: visitor.states[0]["time"] > 2.5)
    visitor.say("pause", is_paused=True)
    page.wait_for_timeout(1500)
    picture, box = picture_of(page)
    (x, y), _ = coral(picture)
    view = page.locator("#view")
    for place, cursor in (((15, 15), "auto"), ((x, y), "grab"), ((15, 15), "auto"), ((x, y), "grab")):
        page.mouse.move(box["x"] + place[0], box["y"] + place[1])
        playwright.expect(view).to_have_css("cursor", cursor)
    page.mouse.down()
    playwright.expect(view).to_have_css("cursor", "grabbing")
    page.mouse.move(box["x"] + 15, box["y"] + 15)
    playwright.expect(view).to_have_css("cursor", "grabbing")
    page.mouse.up()
    playwright.expect(view).to_have_css("cursor", "auto")
    visitor.say("pause", is_paused=False)


def test_an_undo_takes_back_a_slider_and_a_reset_takes_back_all(open_page, visitor):
    page = open_page()
    slider, undo = page.locator("#slider-young"), page.get_by_role("button", name="Undo")
    slider.focus()
    page.keyboard.press("End")
    playwright.expect(slider).to_have_attribute("aria-valuetext", "100 MPa")
    visitor.until(lambda: visitor.states[0]["values"]["young"] == 1e8)
    playwright.expect(undo).to_have_attribute("title", "Undo: Young's modulus")
    undo.click()
    playwright.expect(slider).to_have_attribute("aria-valuetext", "150 kPa")
    page.get_by_label("Preset").select_option("soft_rubber")
    playwright.expect(slider).to_have_attribute("aria-valuetext", "2 MPa")
    slider.focus()
    page.keyboard.press("Home")
    page.locator("#slider-gravity").focus()
    page.keyboard.press("End")
    visitor.until(lambda: visitor.states[0]["values"]["gravity"] == 30.0)
    page.get_by_role("button", name="Reset").click()
    playwright.expect(slider).to_have_attribute("aria-valuetext", "2 MPa")
    playwright.expect(page.locator("#slider-gravity")).to_have_attribute("aria-valuetext", "9.81 m/s²")
    page.get_by_label("Preset").select_option("")
    playwright.expect(slider).to_have_attribute("aria-valuetext", "150 kPa")


def test_until_there_is_a_world_nothing_can_be_chosen_and_the_page_says_what_is_prepared(
    browser, serve, troubles
):
    served = serve("jelly")
    page = browser.new_page()
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(served.address)
    activity = page.locator(".activity")
    playwright.expect(activity.locator(".title")).to_have_text("Preparing jelly", timeout=PATIENCE)
    for _ in range(3):
        if not page.locator("body.empty").count():
            break
        assert (
            page.locator(
                "#controls button:enabled, #controls input:enabled, #controls select:enabled"
            ).count()
            == 0
        )
        words = activity.locator(".step").text_content()
        assert re.fullmatch(
            r"(starting|building bodies|(compiling|loading)( kernel \d+( of about 70)?)?) · \d+ s", words
        )
        page.wait_for_timeout(3000)
    playwright.expect(page.locator("#pause")).to_be_enabled(timeout=4 * PATIENCE)
    playwright.expect(activity).to_have_count(0)
    playwright.expect(page.locator("#said")).to_contain_text("jelly is ready")
    page.close()


def test_a_law_that_is_refused_or_cannot_be_had_is_not_shown_as_chosen(open_page, visitor):
    page = open_page()
    law, strain = page.locator("#law"), page.locator("#strain")
    law.select_option("springs")
    strain.select_option("exact")  # springs have no strain
    page.wait_for_timeout(2500)
    assert law.input_value() == "springs", "what is not used yet stays"
    page.get_by_role("button", name="Use", exact=True).click()
    playwright.expect(page.locator("#said")).to_contain_text("springs", timeout=PATIENCE)
    playwright.expect(law).to_have_value("")
    playwright.expect(strain).to_have_value("")


def test_every_control_has_a_name_and_is_reached_by_the_keyboard(open_page, visitor):
    page = open_page()
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, canvas")].filter(each =>
            !(each.getAttribute("aria-label") || each.labels?.length || each.textContent.trim())
        ).map(each => each.outerHTML)"""
    )
    assert nameless == []
    names = [about["label"] for about in visitor.hello["sliders"]]
    for name in names:
        assert page.get_by_role("slider", name=name).count() == 1
    page.locator("#view").focus()
    reached = set()
    for _ in range(45):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.textContent"))
    wanted = {*(f"slider-{about['name']}" for about in visitor.hello["sliders"])}
    wanted |= {
        "pause",
        "step",
        "reset",
        "frame",
        "law",
        "strain",
        "flips",
        "choose",
        "compare",
        "tint",
        "despawn",
        "upload",
    }
    wanted |= {"shot", "film", "script", "ball", "block", "drum", "ring", "fold"}
    assert wanted <= reached


def test_a_slider_moved_by_keys_changes_the_world_by_the_value_that_it_shows(open_page, visitor):
    page = open_page()
    for about in visitor.hello["sliders"]:
        slider = page.get_by_role("slider", name=about["label"])
        slider.focus()
        before = visitor.states[0]["values"][about["name"]]
        for _ in range(60 if about["is_whole"] else 12):
            page.keyboard.press("ArrowLeft")
        shown = slider.get_attribute("aria-valuetext")
        name = about["name"]
        factor = {"kPa": 1e3, "MPa": 1e6, "Pa": 1.0}[shown.split()[1]] if about["unit"] == "Pa" else 1.0
        wanted = pytest.approx(float(shown.split()[0]) * factor, rel=6e-3)
        assert before != wanted
        visitor.until(lambda name=name, wanted=wanted: visitor.states[0]["values"][name] == wanted)
    back = {"young": 1.5e5, "poisson": 0.4, "damping": 0.15, "gravity": 9.81, "friction": 0.5}
    for name, value in {**back, "substeps": 8, "speed": 1.0}.items():
        visitor.say("set", name=name, value=value)


def test_a_preset_moves_the_sliders_of_the_material(open_page, visitor):
    page = open_page()
    page.get_by_label("Preset").select_option("gelatine")
    wanted = {"young": 1e5, "poisson": 0.45, "damping": 0.08}
    visitor.until(lambda: wanted.items() <= visitor.states[0]["values"].items())
    playwright.expect(page.locator("#slider-young")).to_have_attribute("aria-valuetext", "100 kPa")
    page.get_by_label("Preset").select_option("")
    visitor.until(lambda: visitor.states[0]["values"]["young"] == 1.5e5)


def test_too_few_substeps_are_said_beside_the_slider_before_they_are_felt(open_page, visitor):
    visitor.say("pause", is_paused=True)
    page = open_page()
    page.get_by_role("slider", name="Substeps").focus()
    page.keyboard.press("Home")
    told = page.locator("#slider-substeps-told")
    playwright.expect(told).to_have_text(re.compile(r"^unstable: this material needs \d+$"))
    playwright.expect(told).to_have_class(re.compile("unstable"))
    visitor.say("set", name="substeps", value=8)
    visitor.say("pause", is_paused=False)


@pytest.mark.guard
def test_a_drag_lifts_a_body_and_lets_it_fly_while_a_drag_beside_it_turns_the_view(open_page, visitor):
    page = open_page()
    visitor.until(lambda: visitor.states[0]["time"] > 2.5)
    picture, box = picture_of(page)
    (x, y), count = coral(picture)
    assert count > 100
    before = visitor.body(0).mean(axis=0)
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    for i in range(1, 21):
        page.mouse.move(box["x"] + x, box["y"] + y - 8 * i)
        visitor.listen(0.08)
    lifted = visitor.until(lambda: visitor.body(0).mean(axis=0)[2] > before[2] + 0.3)
    assert lifted
    for i in range(1, 9):  # and to the side
        page.mouse.move(box["x"] + x + 25 * i, box["y"] + y - 160)
        visitor.listen(0.05)
    held = visitor.body(0).mean(axis=0), visitor.pictures[0]["time"]
    page.mouse.up()
    visitor.until(lambda: visitor.body(0).mean(axis=0)[2] < before[2] + 0.25)
    thrown = visitor.body(0).mean(axis=0)
    assert np.linalg.norm(thrown[:2] - before[:2]) > 0.3  # the way of the hand, and on
    assert visitor.pictures[0]["time"] > held[1]
    median, most = map(float, re.fullmatch(r"(\d+), (\d+) ms", page.locator("#late").text_content()).groups())
    assert 0.0 < median <= most
    start, _ = picture_of(page)
    page.mouse.move(box["x"] + 15, box["y"] + 15)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 15, steps=5)
    page.mouse.up()
    page.wait_for_timeout(1500)
    turned, _ = picture_of(page)
    assert (np.abs(turned - start).max(axis=2) > 40).sum() > 500


def test_a_finger_lifts_a_body_too(open_page, visitor):
    page = open_page(390, 844, has_touch=True)
    visitor.say("reset")
    visitor.until(lambda: visitor.states[0]["time"] < 1.0)
    visitor.until(lambda: visitor.states[0]["time"] > 2.5)
    picture, box = picture_of(page)
    place, count = coral(picture)
    assert count > 100
    before = visitor.body(0)[:, 2].mean()
    x, y = box["x"] + place[0], box["y"] + place[1]
    fingers = page.context.new_cdp_session(page)

    def touch(kind, *points):
        points = [{"x": float(at[0]), "y": float(at[1])} for at in points]
        fingers.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})

    touch("Start", (x, y))
    for i in range(1, 16):
        touch("Move", (x, y - 5 * i))
        visitor.listen(0.08)
    assert visitor.until(lambda: visitor.body(0)[:, 2].mean() > before + 0.2)
    assert page.evaluate("window.scrollY") == 0.0
    touch("End")
    visitor.until(lambda: visitor.body(0)[:, 2].mean() < before + 0.1)


def test_two_fingers_bring_the_view_nearer(open_page, visitor):
    visitor.say("pause", is_paused=True)
    page = open_page(390, 844, has_touch=True)
    start, box = picture_of(page)
    fingers = page.context.new_cdp_session(page)
    y = box["y"] + 20.0
    for kind, apart in [("Start", 40), *(("Move", 40 + 3 * i) for i in range(1, 11)), ("End", None)]:
        points = [] if apart is None else [{"x": 195.0 + side * apart, "y": y} for side in (-1, 1)]
        fingers.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
        page.wait_for_timeout(50)
    page.wait_for_timeout(1000)
    assert coral(picture_of(page)[0])[1] > 1.5 * coral(start)[1]
    visitor.say("pause", is_paused=False)


def test_a_browser_that_cannot_draw_is_told_so(browser, served):
    blind = launched(browser.browser_type, "--disable-3d-apis")
    page = blind.new_page()
    page.goto(served.address)
    playwright.expect(page.locator("#said")).to_have_text(re.compile("no WebGL"), timeout=PATIENCE)
    blind.close()


def test_keys_turn_the_view(open_page, visitor):
    visitor.say("pause", is_paused=True)
    page = open_page()
    start, _ = picture_of(page)
    page.locator("#view").focus()
    for key in ("ArrowLeft", "ArrowLeft", "+", "ArrowUp"):
        page.keyboard.press(key)
    page.wait_for_timeout(1500)
    turned, _ = picture_of(page)
    assert (np.abs(turned - start).max(axis=2) > 40).sum() > 500


def test_pause_step_and_reset_do_what_they_say(open_page, visitor):
    page = open_page()
    page.get_by_role("button", name="Pause").click()
    visitor.until(lambda: visitor.states[0]["is_paused"])
    before = visitor.states[0]["time"]
    page.get_by_role("button", name="Step", exact=True).click()
    visitor.until(lambda: visitor.states[0]["time"] > before)
    assert visitor.states[0]["time"] == pytest.approx(before + visitor.states[0]["dt"])
    page.get_by_role("button", name="Reset").click()
    visitor.until(lambda: visitor.states[0]["time"] == 0.0)
    playwright.expect(page.locator("#time")).to_have_text("0.00 s")
    page.get_by_role("button", name="Play").click()
    visitor.until(lambda: not visitor.states[0]["is_paused"])


def test_stress_is_shown_in_colours_with_their_scale(open_page, visitor):
    page = open_page()
    visitor.until(lambda: visitor.states[0]["time"] > 2.5)
    before = honey_count(picture_of(page)[0])
    assert before > 300
    page.get_by_label("Colour by").select_option("stress")
    visitor.until(lambda: visitor.pictures[0]["is_tinted"] and visitor.states[0]["scale"])
    playwright.expect(page.locator("#scale-name")).to_have_text("stress")
    playwright.expect(page.locator("#scale-high")).to_have_text(re.compile(r"^[125]0* k?Pa$"))
    page.wait_for_timeout(2000)
    assert honey_count(picture_of(page)[0]) < 0.3 * before
    page.get_by_label("Colour by").select_option("")
    visitor.until(lambda: not visitor.pictures[0]["is_tinted"])


def test_a_wrong_file_is_refused_on_the_page(open_page, visitor):
    page = open_page()
    wrong = {"name": "broken.obj", "mimeType": "text/plain", "buffer": b"this is no mesh"}
    page.get_by_label("Your own mesh").set_input_files(wrong)
    said = page.locator("#said.refused")
    playwright.expect(said).to_contain_text("broken.obj", timeout=PATIENCE)


def test_a_script_and_a_picture_are_saved(open_page, visitor):
    page = open_page()
    for button, name in (("Image", "live.png"), ("Script and snapshot", "scene.zip")):
        with page.expect_download() as coming:
            page.get_by_role("button", name=button, exact=True).click()
        assert coming.value.suggested_filename == name
        content = Path(coming.value.path()).read_bytes()
        if name.endswith("zip"):
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                assert archive.namelist() == ["scene.py", "scene.snapshot"]
        else:
            assert coral(np.asarray(PIL.open(io.BytesIO(content)).convert("RGB")).astype(int))[1] > 100


def test_a_film_of_the_last_seconds_is_saved(open_page, visitor):
    page = open_page()
    with page.expect_download(timeout=4 * PATIENCE) as coming:
        page.get_by_role("button", name="Film of 10 s").click()
    assert coming.value.suggested_filename == "live.mp4"
    assert Path(coming.value.path()).read_bytes()[4:8] == b"ftyp"


def test_a_page_of_another_address_loads_with_its_token_and_without_it_says_why(browser, serve, troubles):
    served = serve("--host", "0.0.0.0")
    address = f"http://127.0.0.1:{urlsplit(served.address).port}/"
    page = browser.new_page()
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.goto(f"{address}?{urlsplit(served.address).query}")
    playwright.expect(page.locator("#activities")).to_contain_text("Preparing playground", timeout=PATIENCE)
    assert page.goto(address).status == 401
    assert "token" in page.locator("body").inner_text()
    page.close()


def test_a_notebook_of_this_machine_may_show_the_page_within_its_own(browser, served, tmp_path):
    frame = f'<iframe src="{served.address}" width="900" height="600"></iframe>'
    (tmp_path / "notebook.html").write_text(frame)
    handler = functools.partial(SimpleHTTPRequestHandler, directory=tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as notebook:
        threading.Thread(target=notebook.serve_forever, daemon=True).start()
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{notebook.server_port}/notebook.html")
        inner = page.frame_locator("iframe")
        playwright.expect(inner.locator("#time")).to_have_text(re.compile(r"\d s"), timeout=PATIENCE)
        page.close()
        notebook.shutdown()


def test_two_pages_see_one_world_and_a_reload_or_a_close_disturbs_neither(open_page, visitor, served):
    one, two = open_page(900, 500), open_page(900, 500)
    one.get_by_role("button", name="add a ball").click()
    visitor.until(lambda: visitor.states[0]["bodies"] == 7)
    two.reload()
    playwright.expect(two.locator("#fps")).not_to_have_text("0", timeout=PATIENCE)
    one.close()
    before = visitor.counts["pictures"]
    visitor.until(lambda: visitor.counts["pictures"] > before + 30)
    with Visitor(served.address) as another:
        another.ready()
        assert another.states[0]["bodies"] == 7
