"""Show a film in a notebook: HTML with the embedded file and a table of measurements."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from html import escape
from pathlib import Path

MIME_TYPES = {".mp4": "video/mp4", ".webm": "video/webm", ".gif": "image/gif"}
"""MIME types of the film formats that browsers play."""

LARGEST = 10_000_000
"""Largest size of an embedded film [bytes]. The file of the notebook grows by every embedded film."""


def film_html(path: Path | None, figures: Mapping[str, str]) -> str:
    """Return the HTML of a film and a table of figures.

    Args:
        path: path of the film; None if nothing was written.
        figures: formatted values by name.
    """
    rows = "".join(
        f'<tr><th scope="row" style="text-align: left">{escape(name)}</th><td>{escape(value)}</td></tr>'
        for name, value in figures.items()
    )
    return f"<div>{'' if path is None else _shown(path)}<table>{rows}</table></div>"


def _shown(path: Path) -> str:
    """Return the HTML of the film, or the reason why it is not shown."""
    name = escape(str(path), quote=True)
    mime = MIME_TYPES.get(path.suffix.lower())
    if mime is None:
        return f"<p>{name}: images, one per frame</p>"
    if not path.is_file():
        return f"<p>{name} no longer exists</p>"
    size = path.stat().st_size
    if size > LARGEST:
        return f"<p>{name} has {size / 1e6:.0f} MB: too large to show here</p>"
    data = f"data:{mime};base64,{base64.b64encode(path.read_bytes()).decode()}"
    if mime.startswith("image/"):
        return f'<img src="{data}" alt="Film {name}" style="max-width: 100%">'
    style = 'style="max-width: 100%"'
    return f'<video src="{data}" aria-label="Film {name}" controls loop muted playsinline {style}></video>'
