"""Chromium without a window, for pages that have to work in a browser."""

import contextlib
import shutil
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import cv2
import numpy as np
import pytest

ARGUMENTS = (
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
NAMES = ("chromium", "chromium-browser", "google-chrome")

PATIENCE = 120_000
"""What anything may take in it [ms]: it draws without a graphics card, on cores that are busy."""


@contextlib.contextmanager
def chromium(*further):
    """A browser of Playwright, with further arguments. The test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")
    with playwright.sync_playwright() as started:
        browser = launched(started.chromium, *further)
        yield browser
        browser.close()


def launched(kind, *further):
    """Another browser of the same kind: `browser.browser_type` is one."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("needs chromium: apt-get install chromium")
    return kind.launch(executable_path=program, args=[*ARGUMENTS, *further], timeout=PATIENCE)


def opened(browser, address, **options):
    """A page, and lists of what it complained of and what it asked for."""
    page = browser.new_page(**options)
    page.set_default_timeout(PATIENCE)
    complaints, requests = complaints_of(page), []
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    return page, complaints, requests


def complaints_of(page):
    """A list of what a page complains of from now on."""
    complaints = []
    page.on("console", lambda said: said.type in ("error", "warning") and complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    return complaints


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def serving(folder):
    """The address at which the files of a folder are served."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()


def pixels_of(page, selector):
    """What an element looks like now, (height, width, 3), RGB."""
    picture = np.frombuffer(page.locator(selector).screenshot(), np.uint8)
    return cv2.imdecode(picture, cv2.IMREAD_COLOR)[..., ::-1].astype(int)
