"""Escape text for Markdown."""

from __future__ import annotations

import re
from typing import Any


class Literal(str):
    """Text that is not escaped: Markdown, or the path of a file."""


def escaped(value: Any) -> str:
    """Convert a value to one line of text that Markdown prints literally, even in a table."""
    if isinstance(value, Literal):
        return value
    text = " ".join(str(value).split())
    text = re.sub(r"([\\`*_\[\]<>|&~$])", r"\\\1", text)
    # Escape line starts that Markdown would read as a heading, the underline of a heading, or a list item.
    return re.sub(r"^(?=#|[-+](?:\s|$)|[-=]+$)|^(\d+)(?=[.)](?:\s|$))", lambda at: (at[1] or "") + "\\", text)
