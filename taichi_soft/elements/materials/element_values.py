"""Constants of materials: one number for a body, or one number per element."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MaterialError

Array = NDArray[np.float64]

SMALLEST, LARGEST = 1e-9, 1e20
"""Smallest and largest valid constant of a material. Outside this range, forces or accelerations overflow
float32."""

MAX_DAMPING_RATIO = 1000.0
"""Largest valid damping ratio. It is far above the damping that a substep can apply, so a larger ratio would
have no further effect."""

POSITIVE = f"from {SMALLEST:g} to {LARGEST:g}"


def is_positive(x: Array) -> NDArray[np.bool_]:
    """True for values that are positive and in the range of valid constants."""
    return np.asarray((x >= SMALLEST) & (x < LARGEST))


def is_damping(x: Array) -> NDArray[np.bool_]:
    """True for values from 0 to the largest valid constant."""
    return np.asarray((x >= 0) & (x < LARGEST))


def as_ratio(given: Any) -> float:
    """Check a damping ratio and return it as a float. Raises: MaterialError."""
    if isinstance(given, (bool, np.bool_)) or not isinstance(given, (int, float, np.integer, np.floating)):
        raise MaterialError(f"damping_ratio must be one number for the body, got {given!r}")
    if not 0.0 <= given <= MAX_DAMPING_RATIO:
        raise MaterialError(
            f"damping_ratio is {given!r}: it must be from 0 to {MAX_DAMPING_RATIO:g}; 1 is critical damping"
        )
    return float(given)


def as_constant(
    given: Any, name: str, element: str, is_valid: Callable[[Array], Any], range_text: str
) -> float | Array:
    """Check a constant and return it as a float, or as a read-only array with a number per `element`.

    Raises: MaterialError with the first invalid value.
    """
    try:
        if np.asarray(given).dtype.kind not in "iuf":
            raise TypeError
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise MaterialError(f"{name} must be a number or one number per {element}, got {given!r}") from None
    if values.ndim > 1 or values.size == 0:
        raise MaterialError(f"{name} must be a number or a flat array, got an array of shape {values.shape}")
    bad = ~(np.isfinite(values) & is_valid(values))
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        where = "" if values.ndim == 0 else f" of {element} {first}"
        raise MaterialError(f"{name}{where} is {values.reshape(-1)[first]:g}: it must be {range_text}")
    values.flags.writeable = False
    return float(values) if values.ndim == 0 else values


def spread(given: float | Array, name: str, elements: str, count: int) -> Array:
    """Return one value for each of `count` elements. Raises: MaterialError for an array of another length."""
    values = np.asarray(given, dtype=np.float64)
    if values.ndim == 1 and values.shape[0] != count:
        raise MaterialError(
            f"{name} has {values.shape[0]} values for a mesh of {count} {elements}: pass one each"
        )
    return np.ascontiguousarray(np.broadcast_to(values, (count,)))


def described(material: Any) -> str:
    """Return the `repr` of a material. For an array, the `repr` contains its length and its range."""
    given = {each.name: getattr(material, each.name) for each in fields(material)}
    texts = [f"{name}={_text(value)}" for name, value in given.items() if value is not None]
    return f"{type(material).__name__}({', '.join(texts)})"


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return f"<{len(value)} values>"
    if not isinstance(value, np.ndarray):
        return f"{value:g}" if isinstance(value, float) else repr(value)
    if value.ndim == 1:
        return f"<{len(value)} values, {value.min():g} to {value.max():g}>"
    return f"<array {' x '.join(map(str, value.shape))}>"


def require_one_length(given: dict[str, Any], element: str) -> None:
    """Check that all arrays among the constants have the same length. Raises: MaterialError."""
    lengths = {name: len(value) for name, value in given.items() if isinstance(value, np.ndarray)}
    if len(set(lengths.values())) > 1:
        raise MaterialError(f"arrays of different lengths {lengths}: pass one value per {element} in each")
