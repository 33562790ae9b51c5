"""Object file format (.off), as Geomview has it: text, with normals, colours and texture coordinates."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray, as_points
from taichi_soft.meshing.corners import NONE, Attribute, require_vertices, split
from taichi_soft.meshing.surface import Surface, surface_of, vertex_normals
from taichi_soft.meshing.text import as_ascii, numbers, without_comments
from taichi_soft.meshing.triangulation import triangulated
from taichi_soft.meshing.visuals import visual_of

HEADER = re.compile(rb"(ST)?(C)?(N)?OFF(.*)", re.IGNORECASE)


def read_off(path: Path) -> list[Surface]:
    """The surface of an .off file, in its own axes and units.

    Raises: MeshError for a file that is cut short or in another of the format's ways, and for numbers that
        are none.
    """
    lines = without_comments(as_ascii(path.read_bytes()).split(b"\n"))
    header = HEADER.fullmatch(lines[0][0]) if lines else None
    if header is None:
        raise MeshError("it does not begin with OFF: export it anew")
    if header[4]:  # the counts follow without a space, as in ModelNet's files
        lines[0].insert(1, header[4])
    if lines[0][1:2] == [b"BINARY"]:
        raise MeshError("it is a binary .off file: export it as text")
    lines[0:1] = [lines[0][1:]] if len(lines[0]) > 1 else []
    counts = numbers(lines[:1], 2, "line of counts")[0].astype(np.int64) if lines else np.zeros(2, np.int64)
    vertices, faces = lines[1 : 1 + counts[0]], _faces(lines[1 + counts[0] :], int(counts[1]))
    if len(vertices) + len(faces) < counts.sum() or (counts < 0).any():
        raise MeshError(
            f"it is cut short: it is to have {counts[0]:,} vertices and {counts[1]:,} faces, and has "
            f"{len(lines) - 1:,} lines"
        )
    if len(faces) == 0:
        return []
    return [_surface(path.name, [bool(header[k]) for k in (1, 2, 3)], vertices, faces)]


def _faces(lines: list[list[bytes]], count: int) -> list[list[bytes]]:
    """The words of each face: a line, or, where faces run over several lines, as many as it says."""
    if all(int(line[0]) < len(line) for line in lines[:count]):
        return lines[:count]
    words, faces, at = [word for line in lines for word in line], list[list[bytes]](), 0
    while len(faces) < count and at < len(words):
        beyond = at + 1 + max(int(words[at]), 0)
        faces.append(words[at:beyond])
        at = beyond
    return faces


def _surface(name: str, has: list[bool], vertices: list[list[bytes]], faces: list[list[bytes]]) -> Surface:
    points, normals, colors, uv = _columns(vertices, *has)
    sizes = numbers(faces, 1, "face")[:, 0].astype(np.int64)
    if (sizes < 0).any() or any(len(row) <= size for row, size in zip(faces, sizes, strict=True)):
        raise MeshError("a face has fewer vertices than it says: the file is damaged, export it anew")
    flat = [[word] for row, size in zip(faces, sizes, strict=True) for word in row[1 : 1 + size]]
    corners = numbers(flat, 1, "corner")[:, 0].astype(np.int64)
    require_vertices(corners, sizes, len(points))
    triangles, face = triangulated(points[corners], sizes)
    if normals is None:
        normals = vertex_normals(points, corners[triangles])
    shades = _shades([row[1 + size :] for row, size in zip(faces, sizes, strict=True)])
    if colors is None and shades is not None:
        rows, its = shades
        shade = Attribute(rows, np.repeat(its[face][:, None], 3, axis=1))
        made = split(len(points), corners[triangles], (shade,), keep=True)
        colors = np.nan_to_num(made.attributes[0], nan=1.0)
    else:
        made = split(len(points), corners[triangles], (), keep=True)
    visual = visual_of(uv=None if uv is None else uv[made.vertex], colors=colors)
    return surface_of(name, points[made.vertex], made.triangles, normals=normals[made.vertex], visual=visual)


def _columns(
    rows: list[list[bytes]], has_uv: bool, has_color: bool, has_normal: bool
) -> tuple[FloatArray, FloatArray | None, FloatArray | None, FloatArray | None]:
    """Points (n, 3), and what else each vertex has in this order: normals, colours, texture coordinates."""
    points = as_points(numbers(rows, 3, "vertex"))
    normals = colors = uv = None
    if has_normal:
        normals = numbers([row[3:] for row in rows], 3, "normal of vertex")
    at = 6 if has_normal else 3
    if has_color or (not has_uv and all(len(row) >= at + 3 for row in rows)):  # some have OFF for COFF
        colors = numbers([row[at:] for row in rows], 3, "colour of vertex")
    if has_uv:
        uv = numbers([row[-2:] for row in rows], 2, "texture coordinate of vertex")
    return points, normals, colors, uv


def _shades(rows: list[list[bytes]]) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Colours from 0 to 1, and the one of each face, or None. A single number is one of a table elsewhere."""
    has_own = np.array([len(row) >= 3 for row in rows])
    if not has_own.any():
        return None
    own = [row for row in rows if len(row) >= 3]
    shades = numbers(own, 3, "colour of face")
    is_whole = not any(b"." in word for row in own for word in row[:3])
    return shades / (255.0 if is_whole else 1.0), np.where(has_own, np.cumsum(has_own) - 1, NONE)
