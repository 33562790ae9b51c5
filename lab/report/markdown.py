"""Text that Markdown takes literally."""

from __future__ import annotations

import re
from typing import Any


class Literal(str):
    """Text that is Markdown already, or the path of a file with nothing in it to escape."""


def escaped(value: Any) -> str:
    """Any value as words in one line, none of which means anything to Markdown, in tables neither."""
    if isinstance(value, Literal):
        return value
    text = " ".join(str(value).split())
    text = re.sub(r"([\\`*_\[\]<>|&~$])", r"\\\1", text)
    # At the beginning of a line: headings and underlines of headings, lists, numbered lists.
    return re.sub(r"^(?=#|[-+](?:\s|$)|[-=]+$)|^(\d+)(?=[.)](?:\s|$))", lambda at: (at[1] or "") + "\\", text)
