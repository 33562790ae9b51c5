"""Read STL files. Triangles share no vertices. A text file has one surface for each solid."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.surface import Surface, surface_of
from taichi_soft.meshing.text import as_ascii, decoded, numbers
from taichi_soft.meshing.triangulation import triangulated
from taichi_soft.meshing.visuals import visual_of

HEADER = 84
"""Number of bytes before the first triangle. They contain a comment of 80 bytes and the number of
triangles."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("color", "<u2")])

VERTEX = rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)"


def read_stl(path: Path) -> list[Surface]:
    """Read the surfaces of a .stl file, in the axes and units of the file.

    Each vertex has the normal of its triangle.

    Raises: MeshError if the file is cut short or has invalid numbers.
    """
    data = path.read_bytes()
    if len(data) >= HEADER and len(data) == HEADER + TRIANGLE.itemsize * _count(data):
        return _binary(data, path.name)
    text = as_ascii(data)
    if re.match(rb"\s*(solid|facet)\b", text, re.IGNORECASE) and re.search(rb"vertex\s", text, re.IGNORECASE):
        return _text(text, path.name)
    if len(data) < HEADER:
        return []
    return _binary(data, path.name)


def _count(data: bytes) -> int:
    return int.from_bytes(data[HEADER - 4 : HEADER], "little")


def _binary(data: bytes, name: str) -> list[Surface]:
    available = (len(data) - HEADER) // TRIANGLE.itemsize
    if available < _count(data):
        raise MeshError(f"it is cut short: it declares {_count(data):,} triangles and has {available:,}")
    rows = np.frombuffer(data, TRIANGLE, _count(data), HEADER)
    if len(rows) == 0:
        return []
    points = rows["corners"].reshape(-1, 3).astype(np.float64)
    colors = _colors(data[:80], rows["color"].astype(np.int64))
    visual = None if colors is None else visual_of(colors=np.repeat(colors, 3, axis=0))
    return [surface_of(name, points, np.arange(len(points)).reshape(-1, 3), visual=visual)]


def _colors(header: bytes, words: np.ndarray) -> FloatArray | None:  # type: ignore[type-arg]
    """Return the colours of triangles, (m, 3), from 0 to 1, or None without colours.

    A colour has 15 bits. VisCAM sets bit 15 of a triangle that has a colour. Materialise Magics clears bit 15
    instead, and stores a default colour in the header.
    """
    default_at = header.find(b"COLOR=")
    colors = np.stack([words >> 10 & 31, words >> 5 & 31, words & 31], axis=1) / 31.0
    if default_at >= 0 and default_at + 10 <= len(header):
        default = np.frombuffer(header[default_at + 6 : default_at + 9], np.uint8) / 255.0
        return np.where((words >> 15 == 0)[:, None], colors[:, ::-1], default)
    has_color = words >> 15 == 1
    return np.where(has_color[:, None], colors, 1.0) if has_color.any() else None


def _text(text: bytes, name: str) -> list[Surface]:
    surfaces = []
    for solid in re.split(rb"^[ \t]*endsolid\b.*$", text, flags=re.MULTILINE | re.IGNORECASE):
        words = re.search(rb"^[ \t]*solid\b(.*)$", solid, flags=re.MULTILINE | re.IGNORECASE)
        solid_name = decoded(words[1].strip()) if words else ""
        loops = re.split(rb"\bendloop\b", solid[words.end() if words else 0 :], flags=re.IGNORECASE)
        found = [re.findall(VERTEX, loop, re.IGNORECASE) for loop in loops]
        rows = [row for loop in found for row in loop]
        counts = np.array([len(loop) for loop in found], dtype=np.int64)
        if not (counts >= 3).any():
            continue
        points = numbers(rows, 3, "vertex")
        triangles, _ = triangulated(points, counts)
        corners = points[triangles].reshape(-1, 3)
        surfaces.append(surface_of(solid_name or name, corners, np.arange(len(corners)).reshape(-1, 3)))
    return surfaces
