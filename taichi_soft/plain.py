"""What worlds are made of as plain data and back: numbers, texts, lists and dictionaries, for files.

Reading makes objects of the kinds below only, through their own checks: nothing in a file is ever run.
"""

from __future__ import annotations

import json
import math
from base64 import b64decode, b64encode
from enum import Enum
from functools import lru_cache
from hashlib import blake2b
from typing import Any

import numpy as np

from taichi_soft.contact import Contact
from taichi_soft.errors import SnapshotError
from taichi_soft.materials import AnisotropicMaterial, Material, SpringMaterial, Stiffness
from taichi_soft.meshing import ParticleMesh, TetMesh
from taichi_soft.plasticity import Plasticity
from taichi_soft.shapes import BoxShape, CapsuleShape, HeightFieldShape, MeshShape, PlaneShape, SphereShape

FIELDS: dict[type, tuple[str, ...]] = {
    TetMesh: ("vertices", "tets"),
    ParticleMesh: ("vertices", "edges", "masses", "surface"),
    Material: ("young", "poisson", "density", "damping", "shear_modulus", "shear_damping", "damping_ratio"),
    SpringMaterial: ("stiffness", "damping", "rest_length"),
    Stiffness: ("matrix",),
    AnisotropicMaterial: ("stiffness", "density", "damping", "frame", "damping_ratio"),
    Contact: ("friction", "thickness", "itself", "group", "mask"),
    Plasticity: ("yield_stress", "yield_strain", "creep", "maximum"),
    PlaneShape: ("normal",),
    SphereShape: ("radius",),
    BoxShape: ("size",),
    CapsuleShape: ("radius", "length"),
    HeightFieldShape: ("heights", "spacing"),
    MeshShape: ("vertices", "triangles", "cell"),
}
"""What each kind of object is made of again."""

KINDS = {kind.__name__: kind for kind in FIELDS}
_ARRAYS = ("<f4", "<f8", "<i4", "<i8", "|b1")


def as_plain(value: Any) -> Any:
    """A value as data that JSON takes. Raises: SnapshotError for what has no such form."""
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
    elif type(value) in FIELDS:
        parts = {name: as_plain(getattr(value, name)) for name in FIELDS[type(value)]}
        return {"kind": type(value).__name__, **parts}
    raise SnapshotError(f"a {type(value).__name__} cannot be kept in a file: {value!r}")


def from_plain(data: Any) -> Any:
    """The value again. Raises: SnapshotError for data of no known form; what the kind's own checks raise."""
    if isinstance(data, list):
        return [from_plain(each) for each in data]
    if not isinstance(data, dict):
        return data
    if "number" in data:
        return float(data["number"])
    if "array" in data:
        return _array(data)
    kind = KINDS.get(data.get("kind", ""))
    if kind is None or set(data) != {"kind", *FIELDS[kind]}:
        raise SnapshotError(f"unknown data: {sorted(data)}")
    parts = {name: from_plain(data[name]) for name in FIELDS[kind]}
    if kind is MeshShape:
        return MeshShape((parts["vertices"], parts["triangles"]), cell=parts["cell"])
    return kind(**parts)


def _array(data: dict[str, Any]) -> Any:
    try:
        if data["array"] not in _ARRAYS:
            raise ValueError
        return np.frombuffer(b64decode(data["rows"]), data["array"]).reshape(data["shape"]).copy()
    except (KeyError, TypeError, ValueError):
        raise SnapshotError("an array is broken off or of a kind that is not kept in files") from None


def to_json(data: Any) -> bytes:
    """The same bytes for the same plain data."""
    return json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def from_json(content: bytes | memoryview) -> Any:
    """Plain data again. Raises: SnapshotError, also for a number that is not finite, which `to_json` writes
    nowhere."""
    try:
        return json.loads(bytes(content), parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError) as error:
        if isinstance(error, SnapshotError):
            raise
        raise SnapshotError("what should be JSON is none") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise SnapshotError(f"a number in it is not finite: {text}")
    return number


@lru_cache(maxsize=256)
def plain_of(value: Any) -> Any:
    """`as_plain` of an immutable object, made once."""
    return as_plain(value)


@lru_cache(maxsize=256)
def digest_of(value: Any) -> str:
    """A name of an immutable object that another object has only if it is made of the same numbers."""
    return blake2b(to_json(as_plain(value)), digest_size=8).hexdigest()
