"""The page with bodies to turn: one file, which needs no server and loads nothing.

three.js, the viewer and all motions are within it, packed. So a browser opens it from a folder, too.
"""

import base64
import gzip
from collections.abc import Mapping
from pathlib import Path

from taichi_soft.live.three_js import FOLDER as THREE
from taichi_soft.live.three_js import fetch_three_js

HERE = Path(__file__).parent

MODULES = {
    "three-core": THREE / "three.core.js",
    "three": THREE / "three.module.js",
    "orbit-controls": THREE / "OrbitControls.js",
    "viewer": HERE / "viewer.js",
}
"""By the names under which they import each other."""


def write_page(path: Path, motions: Mapping[str, bytes]) -> None:
    """Write it.

    Args:
        path: of the page.
        motions: by the names of their demos, as `motion_of` makes them.
    Raises: OSError where three.js has to be fetched and cannot be.
    """
    fetch_three_js()
    text = (HERE / "page.html").read_text(encoding="utf-8")
    packed = [_element("module", name, gzip.compress(_source(file), 9)) for name, file in MODULES.items()]
    packed += [_element("motion", name, motion) for name, motion in motions.items()]
    fillings = {
        "/* style */": (HERE / "page.css").read_text(encoding="utf-8"),
        "<!-- licence -->": (THREE / "LICENSE").read_text(encoding="utf-8"),
        "<!-- packed -->": "\n".join(packed),
    }
    for place, filling in fillings.items():
        assert text.count(place) == 1, place
        text = text.replace(place, filling)
    path.write_text(text, encoding="utf-8")


def _source(file: Path) -> bytes:
    """A module that imports others by their names: within a page it has no neighbours."""
    return file.read_bytes().replace(b"'./three.core.js'", b"'three-core'")


def _element(kind: str, name: str, packed: bytes) -> str:
    """What the page unpacks."""
    return f'<script type="text/plain" data-{kind}="{name}">{base64.b64encode(packed).decode()}</script>'
