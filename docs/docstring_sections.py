"""Docstrings of this code base as mkdocstrings understands them: a Griffe extension.

Ours write `Args:` without an empty line before it, and `Returns:` and `Raises:` as one sentence each. What a
field of a dataclass is, they say in a comment beside it.
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
    section = ""  # that the present line belongs to
    for line in text.splitlines():
        if found := LIST.match(line) or SENTENCE.match(line):
            section = found[1]
            lines.append("")
            line = line if LIST.match(line) else f"**{section}:** {found[2]}"
        elif line and not line.startswith(" ") and section in ("Args", "Attributes"):
            section = ""
            lines.append("")
        elif section in ("Returns", "Raises", "Warns"):
            line = line.strip()
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
            if attr.parent.is_class and (
                found := COMMENT.search(attr.lines_collection[attr.filepath][attr.lineno - 1])
            ):
                attr.docstring = griffe.Docstring(found[1], parent=attr)
