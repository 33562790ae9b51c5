"""Griffe extension that prepares the docstrings of this code base for mkdocstrings.

Our docstrings have no empty line before `Args:`. `Returns:` and `Raises:` are one sentence each, and
`Example:` contains code. Comments after the fields of a dataclass describe the fields. Signatures show the
values of constants. Classes that only a world can create have no signature.
"""

from __future__ import annotations

import math
import re
import sys
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import griffe

import taichi_soft  # noqa: F401 - loads the modules that define constants

LIST = re.compile(r"^(Args|Attributes):$")
EXAMPLE = "Example:"
SENTENCE = re.compile(r"^(Returns|Raises|Warns): ?(.*)$")
COMMENT = re.compile(r"\s#\s(?!noqa|type:)(.*)$")


def sectioned(text: str) -> str:
    """Return a docstring with an empty line before each section, and its sections as Markdown."""
    lines: list[str] = []
    section = ""  # section of the current line
    for line in text.splitlines():
        if line == EXAMPLE:
            section = EXAMPLE
            lines += ["", "**Example:**", "", "```python"]
            continue
        if section == EXAMPLE and line.startswith("    "):
            lines.append(line[4:])
            continue
        if section == EXAMPLE:
            section = ""
            lines.append("```")
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
    return "\n".join([*lines, "```"] if section == EXAMPLE else lines)


def value_of(default: griffe.Expr, module: str) -> str | None:
    """Return the value of a parameter's default that contains names, as text.

    Return None if the source text of the default is clearer.
    """
    names = [part.name for part in default.iterate(flat=True) if isinstance(part, griffe.ExprName)]
    if not names or module not in sys.modules:
        return None
    value = eval(str(default), vars(sys.modules[module]))
    if isinstance(value, Enum):
        return repr(value.value)
    if is_dataclass(value) and all(getattr(value, each.name) == each.default for each in fields(value)):
        return f"{type(value).__name__}()"
    is_infinite = isinstance(value, float) and math.isinf(value)
    return None if is_infinite or "<" in repr(value) else repr(value)


def described_fields(cls: griffe.Class) -> list[str]:
    """Return a line for each field of a dataclass: the comment after the field, or else its type."""
    lines = []
    for name, member in cls.members.items():
        if not (member.is_attribute and "instance-attribute" in member.labels and member.annotation):
            continue
        beside = member.lines_collection[member.filepath][(member.endlineno or member.lineno) - 1]
        found = COMMENT.search(beside)
        lines.append(f"    {name}: {found[1] if found else f'`{member.annotation}`'}")
    return lines


class DocstringSections(griffe.Extension):
    """Extension whose methods Griffe calls for every object that it has read."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Separate the sections of the object's docstring."""
        if obj.docstring is not None:
            obj.docstring.value = sectioned(obj.docstring.value)

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Replace constants in the defaults of parameters by their values."""
        for parameter in func.parameters:
            if isinstance(parameter.default, griffe.Expr):
                parameter.default = value_of(parameter.default, func.module.path) or parameter.default

    def on_class(self, *, cls: griffe.Class, **_: Any) -> None:
        """List a dataclass's fields if its docstring omits them. Hide constructors that only worlds call."""
        doc, init = cls.docstring, cls.members.get("__init__")
        if init is not None and init.docstring is not None and init.docstring.value.startswith("Use `"):
            del cls.members["__init__"]
        for member in cls.members.values():
            if member.is_attribute and "dataclass" in cls.labels and isinstance(member.value, griffe.Expr):
                member.value = value_of(member.value, cls.module.path) or member.value
        if (
            doc is not None
            and "dataclass" in cls.labels
            and not re.search(r"^(Args|Attributes):", doc.value, re.M)
        ):
            doc.value = "\n".join([*doc.value.splitlines(), "", "Attributes:", *described_fields(cls)])
