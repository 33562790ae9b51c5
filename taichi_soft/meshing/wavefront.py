"""Wavefront .obj: polygons whose corners have a vertex, a texture coordinate and a normal of their own.

One surface for each material, in the order in which faces first use them. Objects and groups are not told
apart.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray, as_points
from taichi_soft.meshing.corners import BEYOND, NONE, Attribute, require_vertices, split
from taichi_soft.meshing.surface import Surface, surface_of, vertex_normals
from taichi_soft.meshing.text import as_ascii, decoded, numbers
from taichi_soft.meshing.triangulation import triangulated
from taichi_soft.meshing.visuals import visual_of
from taichi_soft.meshing.wavefront_materials import read_materials

Ints = NDArray[np.int64]

LEFT_OUT = {b"l": "lines", b"p": "points", b"curv": "curves", b"curv2": "curves", b"surf": "curved surfaces"}
"""Statements that make no triangles."""


@dataclass
class _Content:
    """What the statements of a file say."""

    vertices: list[list[bytes]] = field(default_factory=list)
    places: list[list[bytes]] = field(default_factory=list)  # on a texture
    normals: list[list[bytes]] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)  # rows of these, NONE where not said
    counts: list[int] = field(default_factory=list)  # corners of each face
    material: list[int] = field(default_factory=list)  # of each face
    materials: dict[str, int] = field(default_factory=lambda: {"": 0})  # numbers by name
    libraries: list[bytes] = field(default_factory=list)
    objects: set[str] = field(default_factory=set)
    left_out: dict[str, int] = field(default_factory=dict)

    def name_of(self, material: str, is_one: bool) -> str:
        """Name of the surface of a material: the object's, if it is the only one of the file."""
        if not is_one:
            return material
        return next(iter(self.objects)) if len(self.objects) == 1 else ""


def read_obj(path: Path) -> list[Surface]:
    """Surfaces of a .obj file, in its own axes and units.

    Raises: MeshError for numbers that are none, and for faces of vertices that are not there.
    """
    said = _statements(path.read_bytes())
    if not said.counts:
        return []
    points, colors = _points(said.vertices)
    places = numbers([[*row, b"0"][:2] for row in said.places], 2, "texture coordinate", may_lack=True)
    normals = numbers(said.normals, 3, "normal", may_lack=True)
    rows, counts = np.array(said.corners, dtype=np.int64), np.array(said.counts, dtype=np.int64)
    require_vertices(rows[:, 0], counts, len(points))
    points = as_points(points)
    looks, notes = read_materials(path, said.libraries, set(said.materials) - {""})
    notes += [f"{count:,} {what} are left out" for what, count in said.left_out.items()]
    notes += _without_missing(rows, len(places), len(normals))
    triangles, face = triangulated(points[rows[:, 0]], counts)
    corners, material = rows[triangles], np.array(said.material)[face]
    smooth = vertex_normals(points, corners[..., 0])
    used, first = np.unique(material, return_index=True)
    surfaces = []
    for number in used[np.argsort(first)]:
        vertex, place, normal = np.moveaxis(corners[material == number], 2, 0)
        attributes = Attribute(places, place), Attribute(normals, normal)
        made = split(len(points), vertex, attributes, keep=len(used) == 1)
        uv, own = made.attributes
        name = list(said.materials)[number]
        shades = None if colors is None else colors[made.vertex]
        surfaces.append(
            surface_of(
                said.name_of(name, len(used) == 1) or path.name,
                points[made.vertex],
                made.triangles,
                normals=np.where(np.isnan(own), smooth[made.vertex], own),
                visual=visual_of(uv=uv, colors=shades, look=looks.get(name)),
                notes=tuple(notes),
            )
        )
    return surfaces


def _without_missing(rows: Ints, places: int, normals: int) -> list[str]:
    """Take texture coordinates and normals that are not there from corners (k, 3), and say how many.

    Args:
        places, normals: how many there are.
    """
    notes = []
    for column, length, what in ((1, places, "texture coordinates"), (2, normals, "normals")):
        is_missing = rows[:, column] >= length
        rows[is_missing, column] = NONE
        count = int(is_missing.sum())
        if count:
            who = "1 corner of a face names" if count == 1 else f"{count:,} corners of faces name"
            notes.append(f"{who} {what} that are not there")
    return notes


def _statements(data: bytes) -> _Content:
    said = _Content()
    current = 0
    for line in re.sub(rb"\\[ \t]*\n", b" ", as_ascii(data)).split(b"\n"):
        words = line.split()
        if not words:
            continue
        head = words[0]
        if head == b"v":
            said.vertices.append(_plain(words))
        elif head == b"vt":
            said.places.append(_plain(words))
        elif head == b"vn":
            said.normals.append(_plain(words))
        elif head in (b"f", b"fo"):
            _add_face(said, _plain(words), current)
        elif head == b"usemtl":
            current = said.materials.setdefault(_name(line), len(said.materials))
        elif head == b"mtllib":
            said.libraries.append(line.split(None, 1)[-1].strip())
        elif head == b"o":
            said.objects.add(_name(line))
        elif head in LEFT_OUT:
            said.left_out[LEFT_OUT[head]] = said.left_out.get(LEFT_OUT[head], 0) + 1
    return said


def _plain(words: list[bytes]) -> list[bytes]:
    """Words behind the first one, up to a comment."""
    for number, word in enumerate(words):
        if word.startswith(b"#"):
            return words[1:number]
    return words[1:]


def _name(line: bytes) -> str:
    return decoded(b" ".join(line.split()[1:]))


def _add_face(said: _Content, words: list[bytes], material: int) -> None:
    """Raises: MeshError for a corner that is no index."""
    if len(words) < 3:
        return
    vertices, places, normals = len(said.vertices), len(said.places), len(said.normals)
    try:
        for word in words:
            vertex, _, others = word.partition(b"/")
            place, _, normal = others.partition(b"/")
            said.corners.append(
                (
                    _row(vertex, vertices),
                    _row(place, places) if place else NONE,
                    _row(normal, normals) if normal else NONE,
                )
            )
    except ValueError:
        raise MeshError(
            f"face {len(said.counts)} is '{decoded(b' '.join(words))[:60]}': wanted are whole numbers from "
            "1, or backwards from -1, as in 3/1/2"
        ) from None
    said.counts.append(len(words))
    said.material.append(material)


def _row(index: bytes, length: int) -> int:
    """Row that an index means which counts from 1, or backwards from the last of `length` rows so far."""
    number = int(index)
    if number == 0:
        raise ValueError
    if number > 0:
        return number - 1
    return length + number if length + number >= 0 else BEYOND


def _points(rows: list[list[bytes]]) -> tuple[FloatArray, FloatArray | None]:
    """Vertices (n, 3), and their colours (n, 3) where all have some behind."""
    points = numbers(rows, 3, "vertex")
    if rows and all(len(row) >= 6 for row in rows):
        return points, numbers([row[3:6] for row in rows], 3, "colour of vertex")
    return points, None
