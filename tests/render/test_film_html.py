"""What a notebook shows of a film: the bytes of the file, and the figures of its report."""

import base64
from html.parser import HTMLParser

import numpy as np
import pytest

from taichi_soft.render import VideoWriter, film_html
from taichi_soft.render.film import FilmReport


class Elements(HTMLParser):
    """The attributes of each element, by its name, and all text."""

    def __init__(self, html):
        super().__init__()
        self.found, self.text = {}, []
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.found.setdefault(tag, []).append(dict(attrs))

    def handle_data(self, data):
        self.text.append(data)


def report_of(path):
    """Return the report of a film with two frames.

    The second frame took a quarter of the time that it shows.
    """
    return FilmReport(path, 2, 25.0, 0.04, np.array([0.01]), np.array([0.003, 0.003]))


def written(path):
    with VideoWriter(path, fps=25, size=(32, 16)) as writer:
        for shade in (0, 255):
            writer.write(np.full((16, 32, 3), shade, np.uint8))
    return path


@pytest.mark.parametrize("name", ["a.webm", "a.mp4", "a.gif"])
def test_a_notebook_shows_the_film_that_was_written(tmp_path, name):
    path = written(tmp_path / name)
    page = Elements(report_of(path)._repr_html_())
    (shown,) = page.found["img" if name.endswith("gif") else "video"]
    kind, _, data = shown["src"].partition(";base64,")
    assert kind == {"a.webm": "data:video/webm", "a.mp4": "data:video/mp4", "a.gif": "data:image/gif"}[name]
    assert base64.b64decode(data) == path.read_bytes()
    if name.endswith("gif"):
        assert name in shown["alt"]
    else:
        assert {"controls", "loop", "muted", "playsinline"} < set(shown)
        assert name in shown["aria-label"]


def test_figures_stand_beneath_the_film_as_its_report_has_them(tmp_path):
    page = Elements(report_of(None)._repr_html_())
    assert set(page.found) == {"div", "table", "tr", "th", "td"}
    told = dict(zip(page.text[::2], page.text[1::2], strict=True))
    assert told == {
        "film": "2 frames, 0.1 s",
        "simulated": "0.04 s",
        "steps of a frame": "10.00 ms of 40.0 ms, at the median",
        "speed": "4.0 x real time",
        "drawing of a frame": "3.0 ms, at the median",
    }


def test_a_film_that_is_too_large_or_gone_is_named_in_its_place(tmp_path, monkeypatch):
    path = written(tmp_path / "<a>.gif")
    monkeypatch.setattr(film_html, "LARGEST", path.stat().st_size - 1)
    for expected in ("too large", "no longer exists"):
        page = Elements(report_of(path)._repr_html_())
        assert "img" not in page.found
        assert expected in page.text[0]
        assert "<a>.gif" in page.text[0]
        path.unlink(missing_ok=True)
    assert "images" in Elements(report_of(tmp_path / "a.png")._repr_html_()).text[0]
