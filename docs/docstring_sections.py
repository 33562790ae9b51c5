"""Docstrings of this code base as mkdocstrings understands them: a Griffe extension.

Ours write `Args:` without an empty line before it, `Returns:` and `Raises:` as one sentence each, and what a field
of a dataclass is as a comment beside it.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

LIST = re.compile(r"^(Args|Attributes):$")
SENTENCE = re.compile(r"^(Returns|Raises|Warns): ?(.*)$")
COMMENT = re.compile(r"\s#\s(?!noqa|type:)(.*)$")


def sectioned(text: str) -> str:
    """The docstring with its sections set apart."""
    lines: list[str] = []
    is_list = is_code = False
    for line in text.splitlines():
        if LIST.match(line):
            lines, is_list = [*lines, ""], True
        elif found := SENTENCE.match(line):
            line = f"**{found[1]}:** {found[2]}"
            lines, is_list = [*lines, ""], False
        elif is_list and line and not line.startswith(" "):
            lines, is_list = [*lines, ""], False
        elif not is_list and line.startswith("    ") and not is_code and lines and lines[-1]:
            lines = [*lines, ""] if not lines[-1].startswith(("**Ra", "**Re", "**Wa", "    ")) else lines
            line = line.strip() if lines[-1].startswith(("**Ra", "**Re", "**Wa")) else line
        lines.append(line)
    return "\n".join(lines)


class DocstringSections(griffe.Extension):
    """Griffe calls it for every object that it has read."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Set the sections of its docstring apart."""
        if obj.docstring is not None:
            obj.docstring.value = sectioned(obj.docstring.value)

    def on_attribute(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Take the comment beside a field for its docstring."""
        if attr.docstring is None and attr.lineno is not None and attr.parent is not None:
            if attr.parent.is_class and (found := COMMENT.search(attr.lines_collection[attr.filepath][attr.lineno - 1])):
                attr.docstring = griffe.Docstring(found[1], parent=attr)
