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


def fields(cls: griffe.Class) -> list[str]:
    """What a dataclass says of its fields in comments beside them; where it says nothing, their types."""
    lines = []
    for name, member in cls.members.items():
        if not (member.is_attribute and "instance-attribute" in member.labels and member.annotation):
            continue
        beside = member.lines_collection[member.filepath][(member.endlineno or member.lineno) - 1]
        found = COMMENT.search(beside)
        lines.append(f"    {name}: {found[1] if found else f'`{member.annotation}`'}")
    return lines


class DocstringSections(griffe.Extension):
    """Griffe calls it for every object that it has read."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Set the sections of its docstring apart."""
        if obj.docstring is not None:
            obj.docstring.value = sectioned(obj.docstring.value)

    def on_class(self, *, cls: griffe.Class, **_: Any) -> None:
        """List the fields of a dataclass that does not do so in its docstring."""
        doc = cls.docstring
        if (
            doc is not None
            and "dataclass" in cls.labels
            and not re.search(r"^(Args|Attributes):", doc.value, re.M)
        ):
            doc.value = "\n".join([*doc.value.splitlines(), "", "Attributes:", *fields(cls)])
