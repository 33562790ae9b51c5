"""A glTF 2.0 file: its JSON, its buffers, and arrays read through its accessors.

Source: the glTF 2.0 specification, sections 3.6 (binary data) and 4.4 (GLB).
"""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any, TypeAlias
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.meshing.arrays import FloatArray
from taichi_soft.meshing.io import reject_placeholder

Entry: TypeAlias = "dict[str, Any]"

COMPONENTS: dict[Any, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}

MAX_IMPLICIT_ROWS = 2_000_000
"""Largest number of rows of an accessor without a buffer view. Such rows are zeros that the file does not
contain, so even a small file could request any number of rows."""

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942

REPLACEMENT_CHARACTER = "\ufffd".encode()
"""UTF-8 bytes of the character that text tools write in place of bytes that they cannot decode."""


class Document:
    """The JSON of a .glb or .gltf file, with access to its binary data.

    Attributes:
        json: the JSON object.
        path: path of the file. Names of other files are relative to its folder.
    """

    def __init__(self, path: Path) -> None:
        reject_placeholder(path)
        data = path.read_bytes()
        self.path = path
        self._is_binary = data[:4] == b"glTF"
        text, self._chunk = _chunks(path, data) if self._is_binary else (data, None)
        self.json = _parsed(text)
        self._buffers: dict[int, memoryview] = {}
        version = self.entry("asset").get("version")
        if not isinstance(version, str):
            raise MeshError("cannot be read: it does not say that it is glTF 2.0")
        if version.split(".")[0] != "2":
            raise MeshError(f"is glTF of version {version[:10]}: {upgrade_command(path)}")

    def entry(self, name: str, parent: Entry | None = None) -> Entry:
        """Return the object `name` of `parent`, or an empty object if it is missing. None means the root."""
        found = (self.json if parent is None else parent).get(name, {})
        return found if isinstance(found, dict) else {}

    def entries(self, kind: str) -> list[Any]:
        """Return the list `kind` of the root, such as "nodes", or an empty list."""
        found = self.json.get(kind, [])
        if not isinstance(found, list):
            raise MeshError(f"cannot be read: its {kind!r} are not a list")
        return found

    def named(self, kind: str, number: Any) -> Entry:
        """Return entry `number` of the list `kind`. Raises: MeshError if this entry does not exist."""
        found = self.entries(kind)
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < len(found):
            raise MeshError(f"cannot be read: it refers to {kind}[{number!r}] but has {len(found)} of these")
        entry = found[number]
        if not isinstance(entry, dict):
            raise MeshError(f"cannot be read: its {kind}[{number}] is not an object")
        return entry

    def rows(self, number: Any, *types: str) -> NDArray[Any]:
        """Return the numbers of an accessor as stored, (count, columns).

        Args:
            number: number of the accessor.
            types: allowed values of the accessor's `type`, such as "VEC3".
        Raises: MeshError, before memory is allocated, for an accessor of another type, or for an accessor
            that extends beyond the end of its buffer.
        """
        entry, name = self.named("accessors", number), f"accessor {number}"
        kind, count = entry.get("type"), read_count(entry, "count", name)
        if kind not in types:
            raise MeshError(f"cannot be read: {name} has the type {kind!r} instead of {' or '.join(types)}")
        shape, dtype = (count, COLUMNS[kind]), component_type(entry, name)
        if "bufferView" in entry:
            rows = self._stored(entry, shape, dtype, name)
        elif count > MAX_IMPLICIT_ROWS:
            raise MeshError(
                f"cannot be read: {name} has {count:,} rows without data: {MAX_IMPLICIT_ROWS:,} at most"
            )
        else:
            rows = np.zeros(shape, dtype)
        return self._with_sparse(rows, entry["sparse"], name) if "sparse" in entry else rows

    def values(self, number: Any, *types: str) -> FloatArray:
        """Return an accessor as real numbers, (count, columns). Normalised integers are decoded."""
        rows = self.rows(number, *types)
        return decoded(rows, self.named("accessors", number))

    def view(self, number: Any) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and its stride [bytes], or 0 if the view defines no stride."""
        entry, name = self.named("bufferViews", number), f"buffer view {number}"
        start, length = read_count(entry, "byteOffset", name, 0), read_count(entry, "byteLength", name)
        data = self._buffer(entry.get("buffer"))
        if start + length > len(data):
            raise MeshError(
                f"cannot be read: {name} ends at byte {start + length:,} of a buffer of {len(data):,} bytes"
            )
        return data[start : start + length], read_count(entry, "byteStride", name, 0)

    def fetch(self, uri: Any) -> bytes:
        """Return the content of a data: URI, or of a file whose path is relative to this file.

        Raises: MeshError for a missing file, a network address, an absolute path or, in a .glb, a file
            outside its folder. (The live page reads .glb files from any visitor.)
        """
        if not isinstance(uri, str):
            raise MeshError(f"cannot be read: {uri!r} is not a URI")
        if uri[:5].lower() == "data:":
            return _embedded(uri)
        shown = uri[:100]
        if urlsplit(uri).scheme or uri[:1] in ("/", "\\"):
            raise MeshError(
                f"cannot be read: it refers to {shown!r}: put that file next to it and use only its name"
            )
        candidates = dict.fromkeys([unquote(uri), uri])  # some programs do not percent-encode names
        for name in candidates:
            if self._is_binary and ".." in Path(name.replace("\\", "/")).parts:
                raise MeshError(f"cannot be read: it refers to {shown!r}, outside its folder")
            path = self.path.parent / name
            if "\0" not in name and path.is_file():
                reject_placeholder(path)
                return path.read_bytes()
        raise MeshError(f"cannot be read: it refers to the file {shown!r}, which does not exist")

    def _buffer(self, number: Any) -> memoryview:
        entry, name = self.named("buffers", number), f"buffer {number}"
        if number not in self._buffers:
            data = self._content(number, entry)
            length = read_count(entry, "byteLength", name)
            if len(data) < length:
                raise MeshError(
                    f"cannot be read: it is cut short, {name} has {len(data):,} of {length:,} bytes"
                )
            self._buffers[number] = memoryview(data)[:length]
        return self._buffers[number]

    def _content(self, number: int, entry: Entry) -> bytes:
        if "uri" in entry:
            return self.fetch(entry["uri"])
        if number == 0 and self._chunk is not None:
            return self._chunk
        for extension in MESHOPT:
            if extension in self.entry("extensions", entry):
                raise MeshError(f"is compressed with {extension}: {copy_command(self.path)}")
        raise MeshError(f"cannot be read: buffer {number} has no data")

    def _stored(self, entry: Entry, shape: tuple[int, int], dtype: np.dtype[Any], name: str) -> NDArray[Any]:
        """Return the rows of an accessor as a view of its buffer, without a copy."""
        data, stride = self.view(entry["bufferView"])
        size, start = shape[1] * dtype.itemsize, read_count(entry, "byteOffset", name, 0)
        stride = stride or size
        end = start + (shape[0] - 1) * stride + size
        if stride < size or (shape[0] and end > len(data)):
            raise MeshError(
                f"cannot be read: {name} has {shape[0]:,} rows of {size} bytes, {stride} bytes apart, and "
                f"its buffer view has {max(len(data) - start, 0):,} bytes"
            )
        if shape[0] == 0:
            return np.zeros(shape, dtype)
        return np.asarray(np.ndarray(shape, dtype, data, start, (stride, dtype.itemsize)))

    def _with_sparse(self, rows: NDArray[Any], sparse: Entry, name: str) -> NDArray[Any]:
        """Return a copy of `rows`, with some rows replaced by the rows that a sparse accessor stores."""
        count, name = read_count(sparse, "count", name), f"the sparse part of {name}"
        indices, values = sparse["indices"], sparse["values"]
        replaced = self._stored(indices, (count, 1), component_type(indices, name), name)[:, 0].astype(
            np.int64
        )
        if count and not 0 <= replaced.min() <= replaced.max() < len(rows):
            raise MeshError(f"cannot be read: {name} replaces row {replaced.max():,} of {len(rows):,}")
        changed: NDArray[Any] = rows.copy()
        changed[replaced] = self._stored(values, (count, rows.shape[1]), rows.dtype, name)
        return changed


def decoded(rows: NDArray[Any], accessor: Entry) -> FloatArray:
    """Convert stored numbers to reals. Normalised integers become -1 to 1 or 0 to 1 (section 3.11)."""
    reals = rows.astype(np.float64)
    if accessor.get("normalized") and rows.dtype.kind in "iu":
        reals = np.maximum(reals / np.iinfo(rows.dtype).max, -1.0)
    return reals


def component_type(entry: Entry, name: str) -> np.dtype[Any]:
    """Return the NumPy type of an accessor's numbers. Raises: MeshError for an unknown type."""
    component = entry.get("componentType")
    if component not in COMPONENTS:
        raise MeshError(f"cannot be read: {name} has the unknown component type {component!r}")
    return COMPONENTS[component]


def read_count(entry: Entry, key: str, name: str, default: int | None = None) -> int:
    """Return the count or offset `key` of an entry. Raises: MeshError unless it is an integer from 0."""
    value = entry.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise MeshError(f"cannot be read: {key} of {name} is {value!r}, not a whole number of at least 0")
    return value


def copy_command(path: Path) -> str:
    """Return a hint with a command that copies a file without compression."""
    return (
        f"run `npx @gltf-transform/cli copy {path.name} {path.stem}-plain.glb` (needs Node.js), or export it "
        "without compression"
    )


def upgrade_command(path: Path) -> str:
    """Return a hint with a command that converts an older file to glTF 2.0."""
    return (
        f"only version 2.0 is read. Convert it with `npx gltf-pipeline -i {path.name} -o {path.stem}-2.glb` "
        "(needs Node.js)"
    )


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON chunk of a .glb file, and its binary chunk or None."""
    if len(data) < 20:
        raise MeshError(f"cannot be read: it is cut short, at {len(data)} bytes")
    if REPLACEMENT_CHARACTER in data[:20]:
        raise MeshError(
            "cannot be read: a program has treated it as text. Copy the original as a binary file"
        )
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MeshError(f"is GLB of version {version}: {upgrade_command(path)}")
    if length > len(data):
        raise MeshError(f"cannot be read: it is cut short, {len(data):,} of {length:,} bytes")
    found: dict[int, bytes] = {}
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + size > length:
            raise MeshError(f"cannot be read: a chunk of {size:,} bytes extends beyond its end")
        found.setdefault(kind, data[offset + 8 : offset + 8 + size])
        offset += 8 + size
    if JSON_CHUNK not in found:
        raise MeshError("cannot be read: it has no JSON chunk")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)


def _parsed(text: bytes) -> Entry:
    try:
        found = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())[:200]
        raise MeshError(f"cannot be read: it is not glTF, or damaged ({reason})") from None
    if not isinstance(found, dict):
        raise MeshError("cannot be read: it is not glTF: its JSON is not an object")
    return found


def _embedded(uri: str) -> bytes:
    head, _, body = uri.partition(",")
    content = unquote_to_bytes(body)
    if not head.lower().endswith(";base64"):
        return content
    try:
        return base64.b64decode(content)
    except ValueError:
        raise MeshError("cannot be read: a data: URI in it is damaged") from None
