"""Headless Chromium, for tests of pages in a browser."""

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
"""Time limit for any action in the browser [ms]. The browser draws without a graphics card, on busy cores."""


@contextlib.contextmanager
def chromium(*further):
    """Start a browser of Playwright with additional arguments. Skip the test if no browser is installed."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")
    with playwright.sync_playwright() as started:
        browser = launched(started.chromium, *further)
        yield browser
        browser.close()


def launched(kind, *further):
    """Start another browser of a kind, such as `browser.browser_type`."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("needs chromium: apt-get install chromium")
    return kind.launch(executable_path=program, args=[*ARGUMENTS, *further], timeout=PATIENCE)


def opened(browser, address, **options):
    """Open a page. Return it, the list of its error messages, and the list of its requests."""
    page = browser.new_page(**options)
    page.set_default_timeout(PATIENCE)
    complaints, requests = complaints_of(page), []
    page.on("request", lambda request: requests.append(request.url))
    page.goto(address)
    return page, complaints, requests


def complaints_of(page):
    """Return a list to which new error messages of a page are added."""
    complaints = []
    page.on("console", lambda said: said.type in ("error", "warning") and complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    return complaints


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def serving(folder):
    """Serve the files of a folder, and return the address."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()


def pixels_of(page, selector):
    """Return the current image of an element, RGB (height, width, 3)."""
    picture = np.frombuffer(page.locator(selector).screenshot(), np.uint8)
    return cv2.imdecode(picture, cv2.IMREAD_COLOR)[..., ::-1].astype(int)
