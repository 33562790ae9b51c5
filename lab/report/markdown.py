"""Escape text for Markdown."""

from __future__ import annotations

import re
from typing import Any


class Literal(str):
    """Text that needs no escape: Markdown, or the path of a file."""


def escaped(value: Any) -> str:
    """A value as one line of text that Markdown prints literally, also in tables."""
    if isinstance(value, Literal):
        return value
    text = " ".join(str(value).split())
    text = re.sub(r"([\\`*_\[\]<>|&~$])", r"\\\1", text)
    # At the start of a line: headings and underlines of headings, lists, numbered lists.
    return re.sub(r"^(?=#|[-+](?:\s|$)|[-=]+$)|^(\d+)(?=[.)](?:\s|$))", lambda at: (at[1] or "") + "\\", text)
