"""Convert messages of a visitor's page to checked requests, or refuse them with a reason."""

from __future__ import annotations

import json
from collections.abc import Hashable
from typing import Any

from taichi_soft.core.errors import OptionError
from taichi_soft.core.types import Flips, Strain
from taichi_soft.elements.laws import LAWS
from taichi_soft.live.controls import PRESET_SLIDERS, checked_value
from taichi_soft.live.guard import LARGEST_TEXT
from taichi_soft.live.tints import QUANTITIES

FARTHEST = 1e5
"""Largest coordinate of a point [m] or a direction."""

SAVED = ("script", "film")
"""Files that a visitor can request."""

NEWEST = ("pause", "tint", "preset", "reset", "save", "move")
"""Requests that replace a queued request of the same name."""


def parse_request(text: str) -> dict[str, Any]:
    """Parse a message. Returns: a request with `do`, `pane`, and the arguments of that request.

    Raises: OptionError for a message that is too long, is not JSON, or has an unknown or invalid request.
    """
    if len(text) > LARGEST_TEXT:
        raise OptionError(f"a message must have at most {LARGEST_TEXT} characters, got {len(text)}")
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        raise OptionError("a message must be JSON") from None
    if not isinstance(said, dict) or not isinstance(said.get("do"), str) or said["do"] not in _CHECKS:
        raise OptionError(f"a message must have a 'do', one of {', '.join(_CHECKS)}")
    pane = said.get("pane", 0)
    if pane not in (0, 1) or isinstance(pane, bool):
        raise OptionError(f"pane must be 0 or 1, got {pane!r}")
    return {"do": said["do"], "pane": int(pane), **_CHECKS[said["do"]](said)}


def merge_key(request: dict[str, Any]) -> Hashable:
    """Return the kind of a request, or None.

    A request replaces a queued request of the same kind. A request without a kind replaces none.
    """
    do = request["do"]
    if do == "set":
        return do, request["name"]
    return (do, request["pane"], request.get("what")) if do in NEWEST else None


def _nothing(said: dict[str, Any]) -> dict[str, Any]:
    return {}


def _number(said: dict[str, Any]) -> int:
    number = said.get("number")
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 2**32:
        raise OptionError(f"number must be an integer below 2^32, got {number!r}")
    return number


def _seen(said: dict[str, Any]) -> dict[str, Any]:
    return {"number": _number(said)}


def _set(said: dict[str, Any]) -> dict[str, Any]:
    return {"name": said.get("name"), "value": checked_value(said.get("name"), said.get("value"))}


def _vector(said: dict[str, Any], name: str) -> list[float]:
    rows = said.get(name)
    if not isinstance(rows, list) or len(rows) != 3:
        raise OptionError(f"{name} must be three numbers, got {rows!r}")
    for each in rows:
        if isinstance(each, bool) or not isinstance(each, (int, float)) or each != each:
            raise OptionError(f"{name} must be three numbers, got {rows!r}")
        if not -FARTHEST <= each <= FARTHEST:
            raise OptionError(f"{name} must be within {FARTHEST:g}, got {rows!r}")
    return [float(each) for each in rows]


def _grab(said: dict[str, Any]) -> dict[str, Any]:
    direction = _vector(said, "direction")
    if not any(direction):
        raise OptionError("direction must not be zero")
    return {"origin": _vector(said, "origin"), "direction": direction}


def _move(said: dict[str, Any]) -> dict[str, Any]:
    return {"point": _vector(said, "point"), "number": _number({"number": 0, **said})}


def _flag(said: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(said.get("is_paused"), bool):
        raise OptionError("is_paused must be true or false")
    return {"is_paused": said["is_paused"]}


def _name(said: dict[str, Any]) -> dict[str, Any]:
    name = said.get("name")
    if not isinstance(name, str) or not 0 < len(name) <= 100:
        raise OptionError(f"name must be a word, got {name!r}")
    return {"name": name}


def _one_of(said: dict[str, Any], name: str, choices: Any) -> str | None:
    value = said.get(name)
    if value is not None and (not isinstance(value, str) or value not in choices):
        raise OptionError(f"{name} must be one of {', '.join(choices)}, or null, got {value!r}")
    return value


def _tint(said: dict[str, Any]) -> dict[str, Any]:
    return {"quantity": _one_of(said, "quantity", QUANTITIES)}


def _choose(said: dict[str, Any]) -> dict[str, Any]:
    strains, flips = [each.value for each in Strain], [each.value for each in Flips]
    return {
        "law": _one_of(said, "law", LAWS),
        "strain": _one_of(said, "strain", strains),
        "flips": _one_of(said, "flips", flips),
    }


def _upload(said: dict[str, Any]) -> dict[str, Any]:
    return {**_name(said), "up": _one_of(said, "up", ("y", "z"))}


def _preset(said: dict[str, Any]) -> dict[str, Any]:
    return {"name": _one_of(said, "name", PRESET_SLIDERS)}


def _save(said: dict[str, Any]) -> dict[str, Any]:
    what = _one_of(said, "what", SAVED)
    if what is None:
        raise OptionError(f"what must be one of {', '.join(SAVED)}")
    return {"what": what}


_CHECKS = {
    "seen": _seen,
    "set": _set,
    "preset": _preset,
    "undo": _nothing,
    "grab": _grab,
    "move": _move,
    "release": _nothing,
    "pause": _flag,
    "step": _nothing,
    "reset": _nothing,
    "spawn": _name,
    "despawn": _nothing,
    "tint": _tint,
    "choose": _choose,
    "compare": _choose,
    "alone": _nothing,
    "save": _save,
    "upload": _upload,
}
"""For each request, the function that checks its arguments."""
