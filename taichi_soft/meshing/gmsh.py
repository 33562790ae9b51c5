"""What a mesh is made of in Gmsh's files (.msh), whatever version wrote them and whatever else they hold."""

from __future__ import annotations

import re
from pathlib import Path

from taichi_soft.core.errors import MeshError

NEEDED = ("MeshFormat", "Nodes", "Elements")
"""Sections that meshio is given: over others, such as names and data, it stumbles in sound files."""

OPENING = re.compile(rb"\s*\$(\w+)[ \t]*(?:\r\n?|\n)")


def mesh_sections(path: Path, content: bytes) -> bytes:
    """A Gmsh file of the same mesh that holds its format, nodes and elements only; version 1 becomes 2.2.

    Raises: MeshError for what is no Gmsh file, a section without an end, or one that is missing.
    """
    found = _sections(path, content)
    if "NOD" in found or "ELM" in found:
        found = {
            "MeshFormat": b"2.2 0 8\n",
            "Nodes": _section(path, found, "NOD"),
            "Elements": _modern_elements(path, _section(path, found, "ELM")),
        }
    # In binary files the line's end before `$End...` may be missing; a second one does no harm.
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
    """The bytes of every section by its name, one after the other: binary data may hold anything else."""
    sections: dict[str, bytes] = {}
    place = 0
    while opening := OPENING.match(content, place):
        name = opening[1].decode()
        end = re.compile(rb"\$%b%b(?!\w)" % (b"END" if name.isupper() else b"End", opening[1]))
        closing = end.search(content, opening.end())
        if closing is None:
            raise MeshError(f"{path.name}: section ${name} has no end: the file is cut short")
        if name in sections and name in (*NEEDED, "NOD", "ELM"):
            raise MeshError(f"{path.name}: has two sections ${name}: save each mesh as a file of its own")
        sections[name] = content[opening.end() : closing.start()]
        place = closing.end()
    rest = content[place:].strip()
    if not sections:
        raise MeshError(
            f"{path.name}: not a Gmsh file: it begins with {_quoted(rest)}, not with $MeshFormat or $NOD. "
            "Other programs give their files the same suffix: have them write .vtu or TetGen's .node and .ele"
        )
    if rest:
        raise MeshError(f"{path.name}: {_quoted(rest)} is no section: the file is cut short or damaged")
    return sections


def _quoted(content: bytes) -> str:
    return repr(content[:20].decode("ascii", "replace"))


def _modern_elements(path: Path, old: bytes) -> bytes:
    """Version 1: `number kind physical geometrical count nodes...`; 2.2: `number kind 2 tag tag nodes...`."""
    rows = [line.split() for line in old.splitlines() if line.strip()]
    announced = int(rows[0][0]) if rows and rows[0][0].isdigit() else -1
    rows = rows[1:]
    if len(rows) != announced or any(len(row) < 6 or row[4] != b"%d" % len(row[5:]) for row in rows):
        raise MeshError(f"{path.name}: section $ELM is not what it announces: the file is damaged")
    return b"%d\n" % announced + b"".join(
        b" ".join([*row[:2], b"2", *row[2:4], *row[5:]]) + b"\n" for row in rows
    )
