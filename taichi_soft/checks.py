"""Arguments of the public face, checked before anything is changed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.constants import POSITION_LIMIT
from taichi_soft.errors import OptionError

Floats = NDArray[np.float64]

LARGEST_COUNT = 1_000_000


def as_number(value: Any, name: str, low: float, high: float, text: str) -> float:
    """`value` as a float within [low, high]. Raises: OptionError saying `text`."""
    if isinstance(value, (bool, str)) or np.ndim(value) != 0:
        raise OptionError(f"{name} must be {text}, got {value!r}")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"{name} must be {text}, got {value!r}") from None
    if not (np.isfinite(number) and low <= number <= high):
        raise OptionError(f"{name} must be {text}, got {number:g}")
    return number


def as_positive(value: Any, name: str, unit: str) -> float:
    """`value` as a float above 0. Raises: OptionError."""
    number = as_number(value, name, 0.0, np.inf, f"a number above 0 {unit}")
    if number == 0.0:
        raise OptionError(f"{name} must be a number above 0 {unit}, got 0")
    return number


def as_count(value: Any, name: str) -> int:
    """`value` as a whole number of at least 1. Raises: OptionError."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < 1:
        raise OptionError(f"{name} must be a whole number of at least 1, got {value!r}")
    if value > LARGEST_COUNT:
        raise OptionError(f"{name} must be at most {LARGEST_COUNT}, got {value}: a step would take minutes")
    return int(value)


def as_vector(value: ArrayLike, name: str, unit: str) -> Floats:
    """`value` as three numbers that float32 can still compute with. Raises: OptionError."""
    vector = as_rows(value, name, (3,), unit)
    if np.abs(vector).max() > POSITION_LIMIT:
        raise OptionError(f"{name} must lie within {POSITION_LIMIT:g} {unit} of zero, got {vector.tolist()}")
    return vector


def as_rows(value: ArrayLike, name: str, shape: tuple[int, ...], unit: str) -> Floats:
    """`value` as finite numbers of that shape, copied. Raises: OptionError."""
    try:
        if np.asarray(value).dtype.kind not in "iuf":
            raise TypeError
        rows = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise OptionError(f"{name} must be numbers of shape {shape} [{unit}], got {value!r}") from None
    if rows.shape != shape:
        raise OptionError(f"{name} must have shape {shape} [{unit}], got shape {rows.shape}")
    if not np.isfinite(rows).all():
        raise OptionError(f"{name} must be finite, got {rows[~np.isfinite(rows)][0]} in it")
    return rows


def as_rotation(value: ArrayLike | None) -> Floats:
    """A rotation matrix from a matrix (3, 3), a quaternion (x, y, z, w), or None for no rotation.

    Raises: OptionError if it is neither orthonormal with determinant +1 nor of length 1.
    """
    if value is None:
        return np.eye(3)
    if np.shape(value) == (4,):
        q = as_rows(value, "rotation", (4,), "quaternion x, y, z, w")
        length = float(np.linalg.norm(q))
        if abs(length - 1.0) > 1e-3:
            raise OptionError(f"rotation is a quaternion of length {length:g}: normalise it")
        x, y, z, w = q / length
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
    matrix = as_rows(value, "rotation", (3, 3), "matrix, or quaternion of shape (4,)")
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-5 or np.linalg.det(matrix) < 0:
        raise OptionError("rotation must be an orthonormal matrix with determinant +1")
    return matrix
