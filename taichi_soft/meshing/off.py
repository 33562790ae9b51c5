"""Object file format (.off) of Geomview: text, with normals, colours and texture coordinates."""

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
    """Read the surface of an .off file, in the axes and units of the file.

    Raises: MeshError if the file is cut short, of an unsupported variant, or has invalid numbers.
    """
    lines = without_comments(as_ascii(path.read_bytes()).split(b"\n"))
    header = HEADER.fullmatch(lines[0][0]) if lines else None
    if header is None:
        raise MeshError("it does not begin with OFF: export it again")
    if header[4]:  # the counts follow without a space, as in ModelNet's files
        lines[0].insert(1, header[4])
    if lines[0][1:2] == [b"BINARY"]:
        raise MeshError("it is a binary .off file: export it as text")
    lines[0:1] = [lines[0][1:]] if len(lines[0]) > 1 else []
    counts = numbers(lines[:1], 2, "line of counts")[0].astype(np.int64) if lines else np.zeros(2, np.int64)
    vertices, faces = lines[1 : 1 + counts[0]], _faces(lines[1 + counts[0] :], int(counts[1]))
    if len(vertices) + len(faces) < counts.sum() or (counts < 0).any():
        raise MeshError(
            f"it is cut short: it declares {counts[0]:,} vertices and {counts[1]:,} faces and has "
            f"{len(lines) - 1:,} lines"
        )
    if len(faces) == 0:
        return []
    return [_surface(path.name, [bool(header[k]) for k in (1, 2, 3)], vertices, faces)]


def _faces(lines: list[list[bytes]], count: int) -> list[list[bytes]]:
    """Return the words of each face.

    If faces span several lines, the first word of a face determines how many words belong to the face.
    """
    if all(int(line[0]) < len(line) for line in lines[:count]):
        return lines[:count]
    words, faces, start = [word for line in lines for word in line], list[list[bytes]](), 0
    while len(faces) < count and start < len(words):
        end = start + 1 + max(int(words[start]), 0)
        faces.append(words[start:end])
        start = end
    return faces


def _surface(name: str, has: list[bool], vertices: list[list[bytes]], faces: list[list[bytes]]) -> Surface:
    points, normals, colors, uv = _columns(vertices, *has)
    sizes = numbers(faces, 1, "face")[:, 0].astype(np.int64)
    if (sizes < 0).any() or any(len(row) <= size for row, size in zip(faces, sizes, strict=True)):
        raise MeshError("a face has fewer vertices than its count: the file is damaged, export it again")
    flat = [[word] for row, size in zip(faces, sizes, strict=True) for word in row[1 : 1 + size]]
    corners = numbers(flat, 1, "corner")[:, 0].astype(np.int64)
    require_vertices(corners, sizes, len(points))
    triangles, face = triangulated(points[corners], sizes)
    if normals is None:
        normals = vertex_normals(points, corners[triangles])
    face_colors = _face_colors([row[1 + size :] for row, size in zip(faces, sizes, strict=True)])
    if colors is None and face_colors is not None:
        rows, row_of_face = face_colors
        attribute = Attribute(rows, np.repeat(row_of_face[face][:, None], 3, axis=1))
        result = split(len(points), corners[triangles], (attribute,), keep=True)
        colors = np.nan_to_num(result.attributes[0], nan=1.0)
    else:
        result = split(len(points), corners[triangles], (), keep=True)
    visual = visual_of(uv=None if uv is None else uv[result.vertex], colors=colors)
    return surface_of(
        name, points[result.vertex], result.triangles, normals=normals[result.vertex], visual=visual
    )


def _columns(
    rows: list[list[bytes]], has_uv: bool, has_color: bool, has_normal: bool
) -> tuple[FloatArray, FloatArray | None, FloatArray | None, FloatArray | None]:
    """Return the points, (n, 3), normals, colours and texture coordinates of vertices; None if missing."""
    points = as_points(numbers(rows, 3, "vertex"))
    normals = colors = uv = None
    if has_normal:
        normals = numbers([row[3:] for row in rows], 3, "normal of vertex")
    at = 6 if has_normal else 3
    if has_color or (
        not has_uv and all(len(row) >= at + 3 for row in rows)
    ):  # some files say OFF instead of COFF
        colors = numbers([row[at:] for row in rows], 3, "colour of vertex")
    if has_uv:
        uv = numbers([row[-2:] for row in rows], 2, "texture coordinate of vertex")
    return points, normals, colors, uv


def _face_colors(rows: list[list[bytes]]) -> tuple[FloatArray, NDArray[np.int64]] | None:
    """Return a table of colours from 0 to 1, (c, 3), and the row in the table of each face, (f,).

    Single numbers, which are indices of a colour map, are ignored. The result is None without colours.
    """
    has_color = np.array([len(row) >= 3 for row in rows])
    if not has_color.any():
        return None
    colored = [row for row in rows if len(row) >= 3]
    colors = numbers(colored, 3, "colour of face")
    is_integer = not any(b"." in word for row in colored for word in row[:3])
    return colors / (255.0 if is_integer else 1.0), np.where(has_color, np.cumsum(has_color) - 1, NONE)
