"""Convert the parts of worlds to plain data (numbers, texts, lists and dictionaries) for files, and back.

Reading creates only objects of `serialised` classes, and runs the checks of these classes. Reading never runs
code from a file.
"""

from __future__ import annotations

import json
import math
from base64 import b64decode, b64encode
from collections.abc import Callable
from enum import Enum
from functools import lru_cache
from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import SnapshotError

Kind = TypeVar("Kind")

_FIELDS: dict[type, tuple[str, ...]] = {}
_MAKERS: dict[str, tuple[type, Callable[..., Any]]] = {}
_ARRAYS = ("<f4", "<f8", "<i4", "<i8", "|b1")


def serialised(*fields: str, make: Callable[..., Any] | None = None) -> Callable[[type[Kind]], type[Kind]]:
    """Decorate a class so that its objects can be written to files and read from files.

    Args:
        fields: names of the attributes to store.
        make: function that receives the stored attributes as keyword arguments and returns an object; None
            for the class itself.
    """

    def register(kind: type[Kind]) -> type[Kind]:
        _FIELDS[kind], _MAKERS[kind.__name__] = fields, (kind, make or kind)
        return kind

    return register


def as_plain(value: Any) -> Any:
    """Convert a value to JSON data. Raises: SnapshotError for an unsupported type."""
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(float(value))}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value.value if isinstance(value, Enum) else value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, (list, tuple)):
        return [as_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        little = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        if little.dtype.str in _ARRAYS:
            rows = b64encode(little.tobytes()).decode()
            return {"array": little.dtype.str, "shape": list(value.shape), "rows": rows}
        return as_plain(value.tolist())
    elif type(value) in _FIELDS:
        parts = {name: as_plain(getattr(value, name)) for name in _FIELDS[type(value)]}
        return {"kind": type(value).__name__, **parts}
    raise SnapshotError(f"a {type(value).__name__} cannot be stored in a file: {value!r}")


def from_plain(data: Any) -> Any:
    """Convert the result of `as_plain` back to a value.

    Raises: SnapshotError for unknown data, and the errors that the checks of a class raise.
    """
    if isinstance(data, list):
        return [from_plain(each) for each in data]
    if not isinstance(data, dict):
        return data
    if "number" in data:
        return float(data["number"])
    if "array" in data:
        return _array(data)
    kind, make = _MAKERS.get(data.get("kind", ""), (None, None))
    if kind is None or make is None or set(data) != {"kind", *_FIELDS[kind]}:
        raise SnapshotError(f"unknown data: {sorted(data)}")
    return make(**{name: from_plain(data[name]) for name in _FIELDS[kind]})


def _array(data: dict[str, Any]) -> Any:
    try:
        if data["array"] not in _ARRAYS:
            raise ValueError
        return np.frombuffer(b64decode(data["rows"]), data["array"]).reshape(data["shape"]).copy()
    except (KeyError, TypeError, ValueError):
        raise SnapshotError("an array is cut off or has an unsupported type") from None


def to_json(data: Any) -> bytes:
    """Encode plain data as canonical JSON: equal data gives equal bytes."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def from_json(content: bytes | memoryview) -> Any:
    """Decode JSON. Raises: SnapshotError for invalid JSON and for non-finite numbers, which `to_json` never
    writes.
    """
    try:
        return json.loads(bytes(content), parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError("the data is not valid JSON") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise SnapshotError(f"a number in it is not finite: {text}")
    return number


@lru_cache(maxsize=256)
def plain_of(value: Any) -> Any:
    """Return the result of `as_plain` for an immutable object, from a cache if possible."""
    return as_plain(value)


@lru_cache(maxsize=256)
def digest_of(value: Any) -> str:
    """Return a digest of an immutable object. Only objects with the same content have the same digest."""
    return blake2b(to_json(as_plain(value)), digest_size=8).hexdigest()


# The functions below check data that can be damaged.


def below(number: Any, limit: int) -> int:
    """Check that `number` is from 0 to `limit` - 1, and return it as int. Raises: ValueError, TypeError."""
    if not 0 <= int(number) < limit:
        raise ValueError(f"it has the index {number} of {limit}")
    return int(number)


def vector_of(numbers: Any, count: int, most: float = 1e12) -> NDArray[np.float64]:
    """Check that `numbers` are `count` numbers with absolute values below `most`, and return them, (count,).

    Raises: ValueError if not.
    """
    vector = np.array(numbers, dtype=np.float64)
    if vector.shape != (count,) or not (np.abs(vector) < most).all():
        raise ValueError("a vector is invalid")
    return vector


def indices_below(numbers: Any, limit: int) -> NDArray[np.int32]:
    """Check that `numbers` are one or more integers from 0 to `limit` - 1, and return them, (n,).

    Raises: ValueError if not.
    """
    found = np.array(numbers, dtype=np.int32)
    if found.ndim != 1 or len(found) == 0 or found.min() < 0 or found.max() >= limit:
        raise ValueError("it has invalid vertices")
    return found
