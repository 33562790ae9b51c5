"""Digests of kernels. A digest covers everything that the code of a kernel depends on.

This file is part of `known_kernels`, and is unnecessary once `known_kernels` is unnecessary.
"""

from __future__ import annotations

import enum
import functools
import hashlib
import sys
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

PACKAGE = Path(__file__).resolve().parents[2]


class UnknownPartError(Exception):
    """A kernel depends on an object that has no digest."""


@functools.cache
def digest_of_sources() -> str:
    """Return a digest of everything that determines how a kernel's source is processed.

    The digest covers the package's own files, the interpreter and NumPy.
    """
    found = hashlib.sha256(f"{sys.version} {np.__version__}".encode())
    for path in sorted(PACKAGE.rglob("*.py")):
        found.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def digest_of(function: Any, options: str, arguments: list[tuple[Any, bool]]) -> str:
    """Return a digest of a kernel and its compile-time arguments.

    Args:
        function: Python function of the kernel.
        options: Taichi's options that change code, as text.
        arguments: a pair for each argument. For a template argument, the pair is the value and True. For any
            other argument, the pair is the features for which Taichi compiles separate kernels, and False.
    Raises: UnknownPartError if an argument has no digest.
    """
    parts: list[str] = [digest_of_sources(), options, function.__module__, function.__qualname__]
    if function.__closure__:
        raise UnknownPartError(function.__qualname__)
    seen: dict[int, tuple[int, Any]] = {}
    for value, is_template in arguments:
        _describe(value, parts, seen) if is_template else parts.append(_feature(value))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


def _feature(value: Any) -> str:
    """Return the features of an argument as text, such as the type and the dimensions of an array."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_feature, value))})"
    text = value.to_string() if hasattr(value, "to_string") else str(value)
    if " at 0x" in text:
        raise UnknownPartError(text)
    return text


def _describe(value: Any, parts: list[str], seen: dict[int, tuple[int, Any]]) -> None:
    """Append to `parts` everything in a template argument that can change code."""
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
    seen[id(value)] = len(seen), value  # keep the object alive, so that no other object gets its identity
    if hasattr(value, "snode") and hasattr(value, "vars"):
        parts.append(_field_text(value))
    elif hasattr(value, "field_dict"):  # a field of structs
        _describe(value.field_dict, parts, seen)
    elif hasattr(value, "to_string"):  # a Taichi type
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
    """Return the type, the size and the addresses of a field as text.

    The text does not change after the field is laid out.
    """
    if field not in _field_texts:
        places = " ".join(_place_of(each.ptr.snode()) for each in field.vars)
        size = f"{field.shape} {getattr(field, 'n', 1)} x {getattr(field, 'm', 1)}"
        _field_texts[field] = f"{type(field).__name__} {size} {field.dtype.to_string()} {places}"
    return _field_texts[field]


_places: dict[tuple[int, int], str] = {}


def _place_of(node: Any) -> str:
    """Return the address of one component of a field as text: its node and all nodes that contain it, with
    their offsets. The address also depends on the sizes of other fields.
    """
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
