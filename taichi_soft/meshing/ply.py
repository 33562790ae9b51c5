"""Read polygon files (.ply), text or binary, with their normals, colours and texture coordinates."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray, as_points
from taichi_soft.meshing.corners import Attribute, require_vertices, split
from taichi_soft.meshing.surface import Surface, surface_of, vertex_normals
from taichi_soft.meshing.text import decoded, numbers
from taichi_soft.meshing.triangulation import triangulated
from taichi_soft.meshing.visuals import Look, find_referenced_file, read_image, visual_of

Ints = NDArray[np.int64]

ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}

TYPES = {
    **{b"char": "i1", b"uchar": "u1", b"short": "i2", b"ushort": "u2", b"int": "i4", b"uint": "u4"},
    **{b"int8": "i1", b"uint8": "u1", b"int16": "i2", b"uint16": "u2", b"int32": "i4", b"uint32": "u4"},
    **{b"float": "f4", b"float32": "f4", b"double": "f8", b"float64": "f8"},
}

COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
TEXCOORDS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("s0", "t0"))
"""Names of the two texture coordinates in files of various programs."""


@dataclass
class _Property:
    name: str
    kind: str  # NumPy type of the numbers
    count_kind: str = ""  # NumPy type of a list's length; empty for a single number


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _List:
    """A property with a list in each row. It stores the numbers of all lists in sequence, and the length of
    each list.
    """

    values: FloatArray
    counts: Ints


Columns = dict[str, Any]  # properties of an element by name, each an array (n,) or a `_List`


def read_ply(path: Path) -> list[Surface]:
    """Read the surface of a .ply file, in the axes and units of the file.

    Raises: MeshError if the file is cut short, of another kind, or has invalid numbers.
    """
    data = path.read_bytes()
    order, elements, textures, body = _header(data)
    read: dict[str, Columns] = {}
    reader = _Text(body) if order == "" else _Binary(body, order)
    for element in elements:
        read[element.name] = reader.read(element)
        if "vertex" in read and ("face" in read or "tristrips" in read):
            break  # later elements belong to no triangle
    vertices, faces = read.get("vertex", {}), read.get("face", {})
    corners = next((faces[name] for name in ("vertex_indices", "vertex_index") if name in faces), None)
    strips = read.get("tristrips", {}).get("vertex_indices")
    if corners is None and isinstance(strips, _List):
        corners, faces = _strip_triangles(strips), {}
    if not isinstance(corners, _List) or len(corners.values) == 0:
        return []
    if not all(axis in vertices for axis in "xyz"):
        raise MeshError("its vertices have no x, y and z")
    notes: list[str] = []
    look = _look(path, textures, notes)
    return [_surface(path.name, vertices, faces, corners, look, tuple(notes))]


def _surface(
    name: str, vertices: Columns, faces: Columns, corners: _List, look: Look | None, notes: tuple[str, ...]
) -> Surface:
    points = as_points(np.stack([vertices[axis] for axis in "xyz"], axis=1))
    vertex = corners.values.astype(np.int64)
    require_vertices(vertex, corners.counts, len(points))
    triangles, face = triangulated(points[vertex], corners.counts)
    attributes = []
    uv, colors = _table(vertices, TEXCOORDS), _colors(vertices)
    texcoords, face_colors = faces.get("texcoord"), _colors(faces) if colors is None else None
    has_texcoords = False
    if isinstance(texcoords, _List) and np.array_equal(texcoords.counts, 2 * corners.counts):
        has_texcoords = True
        attributes.append(Attribute(texcoords.values.reshape(-1, 2).astype(np.float64), triangles))
    if face_colors is not None:
        attributes.append(Attribute(face_colors, np.repeat(face[:, None], 3, axis=1)))
    result = split(len(points), vertex[triangles], tuple(attributes), keep=True)
    normals = _table(vertices, (("nx", "ny", "nz"),))
    if normals is None:
        normals = vertex_normals(points, vertex[triangles])
    uv = result.attributes[0] if has_texcoords else None if uv is None else uv[result.vertex]
    if face_colors is not None:
        colors = np.nan_to_num(result.attributes[-1], nan=1.0)
    elif colors is not None:
        colors = colors[result.vertex]
    visual = visual_of(uv=uv, colors=colors, look=look)
    return surface_of(
        name,
        points[result.vertex],
        result.triangles,
        normals=normals[result.vertex],
        visual=visual,
        notes=notes,
    )


def _strip_triangles(strips: _List) -> _List:
    """Convert triangle strips to triangles. The value -1 ends a strip.

    Each vertex forms a triangle with the two vertices before it. Every second triangle is reversed.
    """
    ends = np.cumsum(strips.counts)
    values = np.insert(strips.values.astype(np.int64), ends[:-1], -1)
    triangles = (
        np.stack([values[:-2], values[1:-1], values[2:]], axis=1)
        if len(values) > 2
        else np.zeros((0, 3), int)
    )
    position = np.arange(len(values))
    start = np.maximum.accumulate(np.where(values == -1, position + 1, 0))
    is_odd = (position - start)[: len(triangles)] % 2 == 1
    triangles[is_odd] = triangles[is_odd][:, [1, 0, 2]]
    kept = triangles[
        (triangles >= 0).all(axis=1) & (np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)
    ]
    return _List(kept.ravel().astype(np.float64), np.full(len(kept), 3))


def _table(columns: Columns, choices: tuple[tuple[str, ...], ...]) -> FloatArray | None:
    for names in choices:
        if all(isinstance(columns.get(name), np.ndarray) for name in names):
            return np.stack([columns[name] for name in names], axis=1).astype(np.float64)
    return None


def _colors(columns: Columns) -> FloatArray | None:
    """Return the colours, (n, 3), from 0 to 1, or None without colours.

    16-bit integers are divided by 65535, other integers by 255.
    """
    for names in COLORS:
        if all(isinstance(columns.get(name), np.ndarray) for name in names):
            kind = columns[names[0]].dtype
            rows = np.stack([columns[name] for name in names], axis=1).astype(np.float64)
            if kind.kind in "iu":
                return rows / (65535.0 if kind.itemsize == 2 else 255.0)
            return rows / (255.0 if rows.max(initial=0.0) > 1.0 else 1.0)
    return None


def _look(path: Path, textures: list[str], notes: list[str]) -> Look | None:
    if not textures:
        return None
    file = find_referenced_file(path, textures[0])
    if file is None:
        notes.append(f"the texture {textures[0]} is not read: there is no such file beside it")
        return None
    if len(textures) > 1:
        notes.append(f"it has {len(textures)} textures: the first one covers all of it")
    try:
        return Look("", None, read_image(textures[0], file.read_bytes()))
    except (MeshError, OSError) as error:
        notes.append(str(error))
        return None


def _header(data: bytes) -> tuple[str, list[_Element], list[str], bytes]:
    """Return the byte order ("" for text), elements, names of texture files, and data after the header."""
    start = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    end = (
        re.search(start[1] + rb"end_header[ \t]*" + (b"\r" if start[1] == b"\r" else b"\r?\n"), data)
        if start
        else None
    )
    if start is None or end is None:
        raise MeshError("it does not begin like a .ply file: download or export it again")
    order, elements, textures = None, list[_Element](), list[str]()
    for line in data[start.end() : end.start()].split(start[1]):
        words = line.split()
        if words[:1] == [b"format"] and len(words) > 1:
            order = ORDERS.get(words[1])
        elif words[:2] == [b"comment", b"TextureFile"]:
            textures.append(decoded(b" ".join(words[2:])))
        elif words[:1] == [b"element"] and len(words) == 3 and words[2].isdigit():
            elements.append(_Element(decoded(words[1]), int(words[2])))
        elif words[:1] == [b"property"]:
            if not elements:
                raise MeshError("a property precedes its element: the header is damaged")
            elements[-1].properties.append(_property(words))
    if order is None:
        raise MeshError(f"its format is not one of {', '.join(map(decoded, ORDERS))}")
    return order, elements, textures, data[end.end() :]


def _property(words: list[bytes]) -> _Property:
    kinds = [TYPES.get(word.lower(), "") for word in words[1:-1] if word != b"list"]
    is_list = words[1:2] == [b"list"]
    if len(kinds) != 1 + is_list or not all(kinds):
        raise MeshError(f"the header is damaged: '{decoded(b' '.join(words))[:60]}' is not a property")
    return _Property(decoded(words[-1]), kinds[-1], kinds[0] if is_list else "")


class _Text:
    """Reader of the numbers of a text file, element by element."""

    def __init__(self, body: bytes) -> None:
        self._values = numbers([[word] for word in body.split()], 1, "number")[:, 0]
        self._at = 0

    def read(self, element: _Element) -> Columns:
        if not any(each.count_kind for each in element.properties):
            rows = self._take(element.count * len(element.properties)).reshape(
                element.count, len(element.properties)
            )
            return {
                each.name: column.astype(each.kind if each.kind[0] == "u" else "f8")
                for each, column in zip(element.properties, rows.T, strict=True)
            }
        found: dict[str, list[Any]] = {each.name: [] for each in element.properties}
        for _ in range(element.count):
            for each in element.properties:
                if each.count_kind:
                    found[each.name].append(self._take(int(self._take(1)[0])))
                else:
                    found[each.name].append(self._take(1)[0])
        return _gathered(element, found)

    def _take(self, count: int) -> FloatArray:
        part = self._values[self._at : self._at + count]
        if len(part) != count:
            raise _cut_short()
        self._at += count
        return part


class _Binary:
    """Reader of the numbers of a binary file, element by element."""

    def __init__(self, body: bytes, order: str) -> None:
        self._body, self._order, self._at = body, order, 0

    def read(self, element: _Element) -> Columns:
        lists = [each for each in element.properties if each.count_kind]
        lengths = self._first_lengths(element) if element.count else [0] * len(lists)
        kinds: list[Any] = []
        remaining = iter(lengths)
        for each in element.properties:
            if each.count_kind:
                kinds.append((f"#{each.name}", self._order + each.count_kind))
                kinds.append((each.name, self._order + each.kind, (next(remaining),)))
            else:
                kinds.append((each.name, self._order + each.kind))
        row = np.dtype(kinds)
        if len(self._body) - self._at >= row.itemsize * element.count:
            rows = np.frombuffer(self._body, row, element.count, self._at)
            if all((rows[f"#{each.name}"] == n).all() for each, n in zip(lists, lengths, strict=True)):
                self._at += row.itemsize * element.count
                return {
                    each.name: _List(rows[each.name].ravel(), rows[f"#{each.name}"].astype(np.int64))
                    if each.count_kind
                    else rows[each.name]
                    for each in element.properties
                }
        elif not lists:
            raise _cut_short()
        found: dict[str, list[Any]] = {each.name: [] for each in element.properties}
        for _ in range(element.count):
            for each in element.properties:
                if each.count_kind:
                    found[each.name].append(self._take(each.kind, int(self._take(each.count_kind, 1)[0])))
                else:
                    found[each.name].append(self._take(each.kind, 1)[0])
        return _gathered(element, found)

    def _first_lengths(self, element: _Element) -> list[int]:
        """Return the lengths of the lists in the first row of an element."""
        start, lengths = self._at, []
        for each in element.properties:
            count = 1
            if each.count_kind:
                count = int(self._take(each.count_kind, 1)[0])
                lengths.append(count)
            self._take(each.kind, count)
        self._at = start
        return lengths

    def _take(self, kind: str, count: int) -> NDArray[Any]:
        size = np.dtype(kind).itemsize * count
        if not 0 <= size <= len(self._body) - self._at:
            raise _cut_short()
        self._at += size
        return np.frombuffer(self._body, self._order + kind, count, self._at - size)


def _gathered(element: _Element, found: dict[str, list[Any]]) -> Columns:
    columns: Columns = {}
    for each in element.properties:
        rows = found[each.name]
        if each.count_kind:
            counts = np.array([len(row) for row in rows], dtype=np.int64)
            columns[each.name] = _List(np.concatenate([np.zeros(0), *rows]), counts)
        else:
            columns[each.name] = np.array(rows, dtype=each.kind)
    return columns


def _cut_short() -> MeshError:
    return MeshError(
        "it is cut short: it has fewer numbers than its header says. Download or export it again"
    )
