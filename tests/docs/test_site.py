"""The documentation site, opened from a folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from browser import chromium, opened

from taichi_soft.core.version import VERSION

ROOT = Path(__file__).resolve().parents[2]
WORDS = ("performance", "tutorial", "lag", "license", "android", "multiplayer", "networking")
"""What people search for."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder that `make docs` fills."""
    pytest.importorskip("mkdocstrings", reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    silenced = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=silenced, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.parametrize("width", [1280, 400])
def test_its_home_opens_from_a_folder_and_loads_nothing_from_elsewhere(site, width):
    with chromium() as browser:
        page, complaints, requests = opened(
            browser, f"file://{site}/index.html", viewport={"width": width, "height": 900}
        )
        source = page.locator(".md-source").first
        assert source.get_attribute("href").startswith("https://github.com/")
        assert VERSION in source.inner_text() if width > 1000 else True
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert complaints == []
        assert [address for address in requests if not address.startswith("file:")] == []


def test_its_search_works_from_a_folder_and_knows_what_people_search_for(site):
    with chromium() as browser:
        page, complaints, _ = opened(browser, f"file://{site}/index.html")
        for word in WORDS:
            page.click("input.md-search__input")
            page.fill("input.md-search__input", "")
            page.keyboard.type(word)
            heading = page.locator(".md-search-result__article :is(h1, h2) mark").first
            heading.wait_for()  # a heading that contains a word with this beginning
            assert heading.inner_text().lower().startswith(word[:6]), word
        assert complaints == []
