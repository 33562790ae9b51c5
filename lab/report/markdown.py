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
    # Escape characters at the start of a line that begin or underline a heading, or begin a list.
    return re.sub(r"^(?=#|[-+](?:\s|$)|[-=]+$)|^(\d+)(?=[.)](?:\s|$))", lambda at: (at[1] or "") + "\\", text)
