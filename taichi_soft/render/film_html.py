"""A film in a notebook: the file itself within the HTML, and figures beneath it."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from pathlib import Path

MIME_TYPES = {".mp4": "video/mp4", ".webm": "video/webm", ".gif": "image/gif"}
"""Of what a browser plays."""

LARGEST = 10_000_000
"""A larger film is named and not shown: a notebook is saved with all that it shows [bytes]."""


def film_html(path: Path | None, figures: Mapping[str, str]) -> str:
    """The film and a table.

    Args:
        path: of the film; None where nothing was written.
        figures: what was measured, by name.
    """
    rows = "".join(
        f'<tr><th scope="row" style="text-align: left">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in figures.items()
    )
    return f"<div>{'' if path is None else _shown(path)}<table>{rows}</table></div>"


def _shown(path: Path) -> str:
    """The film, or why there is none."""
    name = escape(str(path), quote=True)
    mime = MIME_TYPES.get(path.suffix.lower())
    if mime is None:
        return f"<p>{name}: pictures, one for each frame</p>"
    if not path.is_file():
        return f"<p>{name} is not there any more</p>"
    size = path.stat().st_size
    if size > LARGEST:
        return f"<p>{name} has {size / 1e6:.0f} MB: too large to be shown here</p>"
    data = f"data:{mime};base64,{base64.b64encode(path.read_bytes()).decode()}"
    if mime.startswith("image/"):
        return f'<img src="{data}" alt="Film {name}" style="max-width: 100%">'
    style = 'style="max-width: 100%"'
    return f'<video src="{data}" aria-label="Film {name}" controls loop muted playsinline {style}></video>'
