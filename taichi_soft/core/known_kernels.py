"""Find kernels that an earlier process compiled, without parsing their source.

Taichi 1.7 stores compiled kernels on disk under a hash of their intermediate representation. To compute that
hash, it processes the source of each kernel at every start, which takes most of a start with a full cache.

Here a known kernel is made with a short body instead, which contains a digest of everything that its code
depends on. When the process that compiled the kernel ends, its code is copied into the file of the short
body. Taichi then finds it by the hash of the short body, which is cheap to compute.

The short body sets a flag. If Taichi does not find the file, it compiles and runs the short body, and the
flag is set after the launch. The short body has no other effect: the kernel is then compiled from source and
launched.
"""

from __future__ import annotations

import ast
import enum
import functools
import hashlib
import json
import os
import re
import sys
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

PACKAGE = Path(__file__).resolve().parents[1]

INDEX = "taichi_soft.json"
"""File next to Taichi's files, with the digests of known kernels."""

FLAG = "__flag"
"""Name of the flag in the short body."""

HEADER = 1 << 17
"""Size of the first part of Taichi's kernel file, which contains the names of its functions [bytes]."""


class UnknownPartError(Exception):
    """A kernel depends on something without a digest."""


@functools.cache
def digest_of_sources() -> str:
    """Digest of the package's files and the versions of Python and NumPy, which determine a kernel's code."""
    found = hashlib.sha256(f"{sys.version} {np.__version__}".encode())
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def digest_of(function: Any, options: str, arguments: list[tuple[Any, bool]]) -> str:
    """Digest of a kernel and its compile-time arguments.

    Args:
        function: the Python function.
        options: Taichi's options that affect code.
        arguments: value of each argument, and True for template arguments; other arguments count by their
            features.
    Raises: UnknownPartError.
    """
    parts: list[str] = [digest_of_sources(), options, function.__module__, function.__qualname__]
    if function.__closure__:
        raise UnknownPartError(function.__qualname__)
    seen: dict[int, tuple[int, Any]] = {}
    for value, is_template in arguments:
        _describe(value, parts, seen) if is_template else parts.append(_feature(value))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


def _feature(value: Any) -> str:
    """Type and dimensions of an array, by which Taichi distinguishes arrays."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_feature, value))})"
    text = value.to_string() if hasattr(value, "to_string") else str(value)
    if " at 0x" in text:
        raise UnknownPartError(text)
    return text


def _describe(value: Any, parts: list[str], seen: dict[int, tuple[int, Any]]) -> None:
    """Add everything of a template argument that can affect code to `parts`."""
    kind = type(value)
    if value is None or kind in (bool, int, float, str, bytes):
        parts.append(repr(value))
        return
    if isinstance(value, (enum.Enum, np.generic)):
        parts.append(f"{kind.__qualname__} {value!r}")
        return
    if id(value) in seen:
        parts.append(f"again {seen[id(value)][0]}")
        return
    seen[id(value)] = len(seen), value  # keeps the object, so that its id is not reused
    if hasattr(value, "snode") and hasattr(value, "vars"):
        parts.append(_field_text(value))
    elif hasattr(value, "field_dict"):  # a field of structures
        _describe(value.field_dict, parts, seen)
    elif hasattr(value, "to_string"):  # a type of Taichi's
        parts.append(value.to_string())
    elif isinstance(value, np.ndarray) and value.dtype != object:
        parts.append(f"array {value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}")
    elif isinstance(value, dict):
        _describe_all(value, [each for item in value.items() for each in item], parts, seen)
    elif isinstance(value, (tuple, list)):
        _describe_all(value, value, parts, seen)
    elif isinstance(value, (set, frozenset)):
        _describe_all(value, sorted(value, key=repr), parts, seen)
    elif isinstance(value, functools.partial):
        _describe_all(value, (value.func, value.args, value.keywords), parts, seen)
    elif isinstance(value, type) or (callable(value) and hasattr(value, "__qualname__")):
        if "<" in value.__qualname__ or not value.__module__.startswith("taichi_soft."):
            raise UnknownPartError(value.__qualname__)
        parts.append(f"{value.__module__} {value.__qualname__}")
    elif hasattr(value, "_data_oriented") or is_dataclass(value):
        parts.append(f"{kind.__module__} {kind.__qualname__}")
        _describe(vars(value), parts, seen)
    else:
        raise UnknownPartError(kind.__qualname__)


_field_texts: WeakKeyDictionary[Any, str] = WeakKeyDictionary()


def _field_text(field: Any) -> str:
    """Type and memory position of a field, which are fixed after its layout."""
    if field not in _field_texts:
        places = " ".join(_place_of(each.ptr.snode()) for each in field.vars)
        size = f"{field.shape} {getattr(field, 'n', 1)} x {getattr(field, 'm', 1)}"
        _field_texts[field] = f"{type(field).__name__} {size} {field.dtype.to_string()} {places}"
    return _field_texts[field]


_places: dict[tuple[int, int], str] = {}


def _place_of(node: Any) -> str:
    """Memory position of a field's number: its offset and those of its parents. It also depends on the sizes
    of other fields."""
    tree, first = node.get_snode_tree_id(), node.id
    if (tree, first) not in _places:
        path = []
        while node is not None:
            path.append((node.id, node.offset_bytes_in_parent_cell, node.cell_size_bytes))
            node = node.parent
        _places[tree, first] = f"{tree} {path}"
    return _places[tree, first]


def _describe_all(value: Any, items: Any, parts: list[str], seen: dict[int, tuple[int, Any]]) -> None:
    parts.append(f"{type(value).__name__} {len(items)}")
    for each in items:
        _describe(each, parts, seen)


def short_body(digest: str) -> list[ast.stmt]:
    """Statements that set the flag to each part of the digest. Each one takes time at every start."""
    words = np.frombuffer(bytes.fromhex(digest), np.int32)
    return ast.parse("\n".join(f"{FLAG}[None] = {word}" for word in (*words.tolist(), 1))).body


def name_of(kernel: Any, digest: str) -> str:
    """Name of a kernel compiled from source, in Taichi's file."""
    return f"{kernel.func.__name__}_{digest}"


def short_name_of(digest: str) -> str:
    """Name of a kernel with the short body."""
    return f"known_{digest}"


class KnownKernels:
    """Known kernels in one folder of Taichi's cache."""

    def __init__(self, folder: Path, options: str) -> None:
        """Read the index. `options`: see `digest_of`."""
        self.folder, self.options = folder, options
        self._known = self._read()

    def __contains__(self, digest: object) -> bool:
        return digest in self._known

    def _read(self) -> set[str]:
        try:
            return set(json.loads((self.folder / INDEX).read_text()))
        except (OSError, ValueError, TypeError):
            return set()

    def keep(self, names: dict[str, str]) -> None:
        """Copy kernels into the files of their short bodies.

        Args:
            names: names of kernels compiled from source, by digest. Taichi must have written all files.
        """
        files = self._files_of({*names.values(), *map(short_name_of, names)})
        kept = []
        for digest, name in names.items():
            code, place = files.get(name), files.get(short_name_of(digest))
            if code and place:
                _write(place, code.read_bytes())
                kept.append(digest)
        if kept:
            _write(self.folder / INDEX, json.dumps(sorted({*self._read(), *kept})).encode())

    def _files_of(self, names: set[str]) -> dict[str, Path]:
        """Files of these kernels, by name."""
        found = {}
        for path in self.folder.glob("*.tic"):
            with path.open("rb") as file:
                match = re.search(rb'"name":"(\w+?)_kernel_\d+_', file.read(HEADER))
            if match and match.group(1).decode() in names:
                found[match.group(1).decode()] = path
        return found


def _write(path: Path, contents: bytes) -> None:
    """Write a file atomically, because other processes may read it."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    part.write_bytes(contents)
    part.replace(path)
