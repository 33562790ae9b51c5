"""Read Wavefront .obj files. A polygon corner has separate indices for vertex, texture coordinate and normal.

There is one surface for each material, in the order in which faces first use the materials. Objects and
groups are merged.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray, as_points
from taichi_soft.meshing.corners import BEFORE_FIRST, NONE, Attribute, require_vertices, split
from taichi_soft.meshing.surface import Surface, surface_of, vertex_normals
from taichi_soft.meshing.text import as_ascii, decoded, numbers
from taichi_soft.meshing.triangulation import triangulated
from taichi_soft.meshing.visuals import visual_of
from taichi_soft.meshing.wavefront_materials import read_materials

Ints = NDArray[np.int64]

SKIPPED = {b"l": "lines", b"p": "points", b"curv": "curves", b"curv2": "curves", b"surf": "curved surfaces"}
"""Statements that define no triangles, and their names in notes."""


@dataclass
class _Content:
    """Parsed statements of a file."""

    vertices: list[list[bytes]] = field(default_factory=list)
    texcoords: list[list[bytes]] = field(default_factory=list)
    normals: list[list[bytes]] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)  # vertex, texcoord and normal, or NONE
    counts: list[int] = field(default_factory=list)  # number of corners of each face
    material: list[int] = field(default_factory=list)  # material number of each face
    materials: dict[str, int] = field(default_factory=lambda: {"": 0})  # material numbers by name
    libraries: list[bytes] = field(default_factory=list)
    objects: set[str] = field(default_factory=set)
    skipped: dict[str, int] = field(default_factory=dict)

    def name_of(self, material: str, is_single: bool) -> str:
        """Return the name of the surface of a material.

        A single surface gets the name of the object, or "" if the file has no object or several objects.
        """
        if not is_single:
            return material
        return next(iter(self.objects)) if len(self.objects) == 1 else ""


def read_obj(path: Path) -> list[Surface]:
    """Read the surfaces of a .obj file, in the axes and units of the file.

    Raises: MeshError for invalid numbers, and for faces that name vertices that do not exist.
    """
    content = _statements(path.read_bytes())
    if not content.counts:
        return []
    points, colors = _points(content.vertices)
    texcoords = numbers(
        [[*row, b"0"][:2] for row in content.texcoords], 2, "texture coordinate", allow_missing=True
    )
    normals = numbers(content.normals, 3, "normal", allow_missing=True)
    rows, counts = np.array(content.corners, dtype=np.int64), np.array(content.counts, dtype=np.int64)
    require_vertices(rows[:, 0], counts, len(points))
    points = as_points(points)
    looks, notes = read_materials(path, content.libraries, set(content.materials) - {""})
    notes += [f"{count:,} {name} are skipped" for name, count in content.skipped.items()]
    notes += _remove_missing(rows, len(texcoords), len(normals))
    triangles, face = triangulated(points[rows[:, 0]], counts)
    corners, material = rows[triangles], np.array(content.material)[face]
    smooth = vertex_normals(points, corners[..., 0])
    used, first = np.unique(material, return_index=True)
    surfaces = []
    for number in used[np.argsort(first)]:
        vertex, texcoord, normal = np.moveaxis(corners[material == number], 2, 0)
        attributes = Attribute(texcoords, texcoord), Attribute(normals, normal)
        result = split(len(points), vertex, attributes, keep=len(used) == 1)
        uv, file_normals = result.attributes
        name = list(content.materials)[number]
        vertex_colors = None if colors is None else colors[result.vertex]
        surfaces.append(
            surface_of(
                content.name_of(name, len(used) == 1) or path.name,
                points[result.vertex],
                result.triangles,
                normals=np.where(np.isnan(file_normals), smooth[result.vertex], file_normals),
                visual=visual_of(uv=uv, colors=vertex_colors, look=looks.get(name)),
                notes=tuple(notes),
            )
        )
    return surfaces


def _remove_missing(rows: Ints, texcoords: int, normals: int) -> list[str]:
    """Replace rows of texture coordinates and normals that do not exist by NONE.

    Returns: notes with the number of replaced rows.
    Args:
        rows: vertex, texture coordinate and normal of each corner, (k, 3), changed in place.
        texcoords, normals: number of texture coordinates and of normals in the file.
    """
    notes = []
    for column, length, kind in ((1, texcoords, "texture coordinates"), (2, normals, "normals")):
        is_missing = rows[:, column] >= length
        rows[is_missing, column] = NONE
        count = int(is_missing.sum())
        if count:
            subject = "1 corner of a face refers" if count == 1 else f"{count:,} corners of faces refer"
            notes.append(f"{subject} to {kind} that do not exist")
    return notes


def _statements(data: bytes) -> _Content:
    content = _Content()
    current = 0
    for line in re.sub(rb"\\[ \t]*\n", b" ", as_ascii(data)).split(b"\n"):
        words = line.split()
        if not words:
            continue
        head = words[0]
        if head == b"v":
            content.vertices.append(_arguments(words))
        elif head == b"vt":
            content.texcoords.append(_arguments(words))
        elif head == b"vn":
            content.normals.append(_arguments(words))
        elif head in (b"f", b"fo"):
            _add_face(content, _arguments(words), current)
        elif head == b"usemtl":
            current = content.materials.setdefault(_name(line), len(content.materials))
        elif head == b"mtllib":
            content.libraries.append(line.split(None, 1)[-1].strip())
        elif head == b"o":
            content.objects.add(_name(line))
        elif head in SKIPPED:
            content.skipped[SKIPPED[head]] = content.skipped.get(SKIPPED[head], 0) + 1
    return content


def _arguments(words: list[bytes]) -> list[bytes]:
    """Return the words after the first word, up to a comment."""
    for number, word in enumerate(words):
        if word.startswith(b"#"):
            return words[1:number]
    return words[1:]


def _name(line: bytes) -> str:
    return decoded(b" ".join(line.split()[1:]))


def _add_face(content: _Content, words: list[bytes], material: int) -> None:
    """Add a face. Raises: MeshError for a corner that is not an index."""
    if len(words) < 3:
        return
    vertices, texcoords, normals = len(content.vertices), len(content.texcoords), len(content.normals)
    try:
        for word in words:
            vertex, _, others = word.partition(b"/")
            texcoord, _, normal = others.partition(b"/")
            content.corners.append(
                (
                    _row(vertex, vertices),
                    _row(texcoord, texcoords) if texcoord else NONE,
                    _row(normal, normals) if normal else NONE,
                )
            )
    except ValueError:
        raise MeshError(
            f"face {len(content.counts)} is '{decoded(b' '.join(words))[:60]}': expected whole numbers from "
            "1, or backwards from -1, as in 3/1/2"
        ) from None
    content.counts.append(len(words))
    content.material.append(material)


def _row(index: bytes, length: int) -> int:
    """Convert an index of a file to a row, counted from 0.

    A positive index counts from 1. A negative index counts backwards from the end of the `length` rows that
    precede the face.
    """
    number = int(index)
    if number == 0:
        raise ValueError
    if number > 0:
        return number - 1
    return length + number if length + number >= 0 else BEFORE_FIRST


def _points(rows: list[list[bytes]]) -> tuple[FloatArray, FloatArray | None]:
    """Return the vertices, (n, 3), and their colours, (n, 3), or None unless all vertices have a colour."""
    points = numbers(rows, 3, "vertex")
    if rows and all(len(row) >= 6 for row in rows):
        return points, numbers([row[3:6] for row in rows], 3, "colour of vertex")
    return points, None
