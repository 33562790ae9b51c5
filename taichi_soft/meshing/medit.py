"""Reduce Medit text files (.mesh) to vertices and cells."""

from __future__ import annotations

import re
from pathlib import Path

from taichi_soft.core.errors import MeshError

NODES = {
    b"Edges": 2,
    b"Triangles": 3,
    b"Quadrilaterals": 4,
    b"Tetrahedra": 4,
    b"Prisms": 6,
    b"Pyramids": 5,
    b"Hexahedra": 8,
    b"Hexaedra": 8,
}
"""Number of vertices of each kind of cell."""

KEYWORD = re.compile(rb"(?<![\w.+-])([A-Za-z]\w*)")


def mesh_sections(path: Path, content: bytes) -> bytes:
    """Return a Medit file with only the vertices and cells, in the layout that meshio reads.

    Raises: MeshError if the content is not a Medit text file, or a section does not match its count.
    """
    _, *words = KEYWORD.split(re.sub(rb"#[^\n]*", b"", content))
    if not words or words[0] != b"MeshVersionFormatted":
        start = content[:20].decode("ascii", "replace")
        raise MeshError(
            f"{path.name}: not a Medit text file: it begins with {start!r}, not with MeshVersionFormatted. "
            "Other programs use the same suffix: save as .vtu instead"
        )
    found = list(zip(words[::2], (body.split() for body in words[1::2]), strict=True))
    dimension = next((body[0] for word, body in found if word == b"Dimension" and body), b"?")
    if dimension != b"3":
        got = dimension.decode("ascii", "replace")
        raise MeshError(f"{path.name}: has dimension {got}: a body needs 3")
    lines = [b"MeshVersionFormatted 2", b"Dimension 3"]
    for word, body in found:
        columns = 1 + (3 if word == b"Vertices" else NODES.get(word, 0))  # the last column is a label
        if columns == 1:
            continue
        count = int(body[0]) if body and body[0].isdigit() else -1
        if len(body) != 1 + count * columns:
            raise MeshError(
                f"{path.name}: {word.decode()} declares {count} rows of {columns} and has {len(body) - 1} "
                "numbers: the file is cut short or damaged"
            )
        if count:
            lines += [word, body[0], b" ".join(body[1:])]
    return b"\n".join([*lines, b"End\n"])
