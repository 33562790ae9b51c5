"""Display of a sweep's progress."""

import io

import pytest
from rich.console import Console

from lab.sweep import progress, show_progress

pytestmark = pytest.mark.soak


def shown(console):
    with show_progress(console, 4) as advance:
        for name in ("a", "b", "c"):
            advance(name)
    return console.file.getvalue()


def test_a_terminal_has_a_bar():
    text = shown(Console(file=io.StringIO(), force_terminal=True, width=100))
    assert "3/4" in text
    assert "points" not in text


@pytest.mark.parametrize(("every", "lines"), [(0.0, 3), (60.0, 0)])
def test_elsewhere_there_is_a_line_now_and_then(monkeypatch, every, lines):
    monkeypatch.setattr(progress, "LINE_EVERY", every)
    text = shown(Console(file=io.StringIO(), width=100))
    assert len(text.splitlines()) == lines
    if lines:
        assert text.splitlines()[-1].startswith("3 of 4 points, about 0 s left")
