"""Reduce Gmsh files (.msh) of any version to the sections that define the mesh."""

from __future__ import annotations

import re
from pathlib import Path

from taichi_soft.core.errors import MeshError

NEEDED = ("MeshFormat", "Nodes", "Elements")
"""Sections that are passed to meshio. Other sections, such as names and data, are dropped, because meshio can
fail on them even if the file is valid."""

OPENING = re.compile(rb"\s*\$(\w+)[ \t]*(?:\r\n?|\n)")


def mesh_sections(path: Path, content: bytes) -> bytes:
    """Return a Gmsh file with only the format, nodes and elements of the mesh. Version 1 is converted to 2.2.

    Raises: MeshError if the content is not a Gmsh file, or a section is missing or has no end.
    """
    found = _sections(path, content)
    if "NOD" in found or "ELM" in found:
        found = {
            "MeshFormat": b"2.2 0 8\n",
            "Nodes": _section(path, found, "NOD"),
            "Elements": _modern_elements(path, _section(path, found, "ELM")),
        }
    # Binary files can lack the line break before `$End...`. A second line break is harmless.
    return b"".join(
        b"$%b\n%b\n$End%b\n" % (name.encode(), _section(path, found, name), name.encode()) for name in NEEDED
    )


def _section(path: Path, sections: dict[str, bytes], name: str) -> bytes:
    if name not in sections:
        raise MeshError(
            f"{path.name}: has no section ${name}, only {', '.join(f'${word}' for word in sections)}"
        )
    return sections[name]


def _sections(path: Path, content: bytes) -> dict[str, bytes]:
    """Return the bytes of each section by name.

    Sections are parsed in order, because binary data can contain words that look like the start of a section.
    """
    sections: dict[str, bytes] = {}
    position = 0
    while opening := OPENING.match(content, position):
        name = opening[1].decode()
        end = re.compile(rb"\$%b%b(?!\w)" % (b"END" if name.isupper() else b"End", opening[1]))
        closing = end.search(content, opening.end())
        if closing is None:
            raise MeshError(f"{path.name}: section ${name} has no end: the file is cut short")
        if name in sections and name in (*NEEDED, "NOD", "ELM"):
            raise MeshError(f"{path.name}: has two sections ${name}: save each mesh to its own file")
        sections[name] = content[opening.end() : closing.start()]
        position = closing.end()
    rest = content[position:].strip()
    if not sections:
        raise MeshError(
            f"{path.name}: not a Gmsh file: it begins with {_quoted(rest)}, not with $MeshFormat or $NOD. "
            "Other programs use the same suffix: save as .vtu or as TetGen's .node and .ele instead"
        )
    if rest:
        raise MeshError(f"{path.name}: {_quoted(rest)} is not a section: the file is cut short or damaged")
    return sections


def _quoted(content: bytes) -> str:
    return repr(content[:20].decode("ascii", "replace"))


def _modern_elements(path: Path, old: bytes) -> bytes:
    """Convert elements of version 1 to version 2.2.

    A row of version 1 is `number kind physical geometrical count nodes...`. A row of version 2.2 is
    `number kind 2 tag tag nodes...`.
    """
    rows = [line.split() for line in old.splitlines() if line.strip()]
    declared = int(rows[0][0]) if rows and rows[0][0].isdigit() else -1
    rows = rows[1:]
    if len(rows) != declared or any(len(row) < 6 or row[4] != b"%d" % len(row[5:]) for row in rows):
        raise MeshError(f"{path.name}: section $ELM does not match its counts: the file is damaged")
    return b"%d\n" % declared + b"".join(
        b" ".join([*row[:2], b"2", *row[2:4], *row[5:]]) + b"\n" for row in rows
    )
