"""Check arguments of the public interface before a call changes anything."""

from __future__ import annotations

import os
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.constants import POSITION_LIMIT
from taichi_soft.core.errors import OptionError
from taichi_soft.core.math.rotations import length_of, turning_rows

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

LARGEST_COUNT = 1_000_000
"""Default upper limit of counts, such as substeps, bodies, pixels or frames. Larger counts would take too
long to compute or overflow 32 bits."""

SHORTEST_STEP, LONGEST_STEP = 1e-9, 1e4
"""Shortest and longest valid fixed step [s]. A shorter step would be lost to float32 rounding. A longer step
would take days to compute."""


def as_number(value: Any, name: str, low: float, high: float, text: str = "") -> float:
    """Convert `value` to a float, and check that it is in [low, high].

    Raises: OptionError. The message states the valid values as `text`, or as the range if `text` is empty.
    """
    wanted = text or f"a number from {low:g} to {high:g}"
    if isinstance(value, (bool, np.bool_, str)) or getattr(value, "ndim", 0) != 0:
        raise OptionError(f"{name} must be {wanted}, got {value!r}")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise OptionError(f"{name} must be {wanted}, got {value!r}") from None
    if not (np.isfinite(number) and low <= number <= high):
        raise OptionError(f"{name} must be {wanted}, got {number:g}")
    return number


def as_positive(value: Any, name: str, unit: str) -> float:
    """Convert `value` to a float above 0. Raises: OptionError for other values."""
    number = as_number(value, name, 0.0, np.inf, f"a number above 0 {unit}")
    if number == 0.0:
        raise OptionError(f"{name} must be a number above 0 {unit}, got 0")
    return number


def as_step(dt: float) -> float:
    """Check the length of a fixed step [s], and return it. Raises: OptionError if it is out of range."""
    return as_number(dt, "dt", SHORTEST_STEP, LONGEST_STEP, "a number above 0 s, from 1e-9 to 1e4")


def as_count(value: Any, name: str, low: int = 1, high: int = LARGEST_COUNT) -> int:
    """Check that `value` is an integer from `low` to `high`, and return it. Raises: OptionError if not."""
    is_whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not is_whole or not low <= value <= high:
        raise OptionError(f"{name} must be a whole number from {low} to {high}, got {value!r}")
    return int(value)


def choose_one_of(names: Iterable[str], given: Any) -> str:
    """Return advice for an unknown name: all known names, and the known name most similar to `given`."""
    known = list(names)
    close = get_close_matches(given, known, n=1) if isinstance(given, str) else []
    guess = f". Did you mean {close[0]!r}?" if close else ""
    return f"choose one of {', '.join(map(repr, known))}{guess}"


def as_flag(value: Any, name: str) -> bool:
    """Check that `value` is True or False, and return it. Raises: OptionError if not."""
    if not isinstance(value, (bool, np.bool_)):
        raise OptionError(f"{name} must be True or False, got {value!r}")
    return bool(value)


def _is_plain(value: Any) -> bool:
    return type(value) is float or type(value) is int


def as_vector(value: ArrayLike, name: str, unit: str, limit: float = POSITION_LIMIT) -> Floats:
    """Convert `value` to three floats with absolute values below `limit`, (3,). Raises: OptionError."""
    if isinstance(value, tuple) and len(value) == 3 and all(_is_plain(x) and abs(x) < limit for x in value):
        return np.array(value, dtype=np.float64)  # fast path: games move many objects per frame
    vector = as_array(value, name, (3,), unit)
    if not np.abs(vector).max() < limit:
        raise OptionError(f"{name} must lie within {limit:g} {unit} of zero, got {vector.tolist()}")
    return vector


def as_gravity(value: ArrayLike) -> Floats:
    """Convert `value` to the gravity of a world, (3,) [m/s^2], read-only. Raises: OptionError."""
    gravity = as_vector(value, "gravity", "m/s^2")
    gravity.flags.writeable = False
    return gravity


def as_friction(value: Any) -> float:
    """Convert `value` to a Coulomb friction coefficient. Raises: OptionError."""
    return as_number(value, "friction", 0.0, 1e6, "a number from 0 to 1,000,000")


def to_array(values: Any, name: str) -> NDArray[Any]:
    """Convert `values` to an array of any dtype. Raises: OptionError if rows have unequal lengths."""
    try:
        return np.asarray(values)
    except (ValueError, TypeError) as error:
        raise OptionError(f"{name} is not an array of numbers ({error})") from None


def as_array(values: ArrayLike, name: str, shape: tuple[int | None, ...], unit: str = "") -> Floats:
    """Copy `values` to a float64 array. Check the shape of the array, and that all its numbers are finite.

    None in `shape` allows any length. Raises: OptionError.
    """
    lengths = ", ".join("n" if length is None else str(length) for length in shape)
    wanted = f"({lengths}{',' if len(shape) == 1 else ''})" + (f" [{unit}]" if unit else "")
    array = to_array(values, name)
    if array.dtype.kind not in "fiu":
        raise OptionError(f"{name} must be numbers of shape {wanted}, got {values!r}")
    if array.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, array.shape, strict=True)
    ):
        raise OptionError(f"{name} must have shape {wanted}, got shape {array.shape}")
    real = array.astype(np.float64)  # `astype` always makes a copy
    # Check the sum first, because this is faster than checking every number.
    if not np.isfinite(real.sum()) and not np.isfinite(real).all():
        first = int(np.argmin(np.isfinite(real.reshape(len(real), -1)).all(axis=1)))
        raise OptionError(f"{name} must be finite, but entry {first} is {real[first].tolist()}")
    return real


def as_indices(values: ArrayLike, name: str, count: int) -> NDArray[np.int32]:
    """Convert `values` to unique integers from 0 to `count` - 1, in ascending order. Raises: OptionError."""
    array = to_array(values, name)
    if array.size == 0 and array.ndim == 1:
        return np.zeros(0, dtype=np.int32)
    if array.dtype.kind not in "iu" or array.ndim != 1:
        raise OptionError(f"{name} must be a list of vertex numbers, got {values!r}")
    if array.min() < 0 or array.max() >= count:
        worst = int(array.min() if array.min() < 0 else array.max())
        raise OptionError(f"{name} names vertex {worst}: there are {count}, from 0 to {count - 1}")
    return np.unique(array).astype(np.int32)


def as_buffer(out: Any, name: str, count: int) -> Floats32:
    """Check that `out` is an array for `count` positions or normals, (count, 3), and return it.

    If `out` is None, return a new array. Raises: OptionError.
    """
    if out is None:
        return np.empty((count, 3), dtype=np.float32)
    if not isinstance(out, np.ndarray):
        raise OptionError(f"{name} must be a numpy array, got {type(out).__name__}")
    if out.shape != (count, 3) or out.dtype != np.float32:
        raise OptionError(
            f"{name} must be float32 of shape ({count}, 3), got {out.dtype} of shape {out.shape}"
        )
    if not (out.flags.c_contiguous and out.flags.writeable):
        raise OptionError(
            f"{name} must be C-contiguous and writeable: make it with numpy.empty((n, 3), numpy.float32)"
        )
    return out


def as_path(value: Any) -> Path:
    """Convert `value` to a file path. Raises: OptionError."""
    if not isinstance(value, (str, os.PathLike)):
        raise OptionError(f"path must be a string or a Path, got {value!r}")
    path = Path(os.fsdecode(value))
    if not path.name or "\0" in str(path):
        raise OptionError(f"path {str(path)!r} names no file")
    return path


def as_rotation(value: Any) -> Floats:
    """Convert a rotation to a rotation matrix, (3, 3).

    Args:
        value: matrix (3, 3), quaternion (x, y, z, w), or None for no rotation.
    Raises: OptionError for a matrix that is not orthonormal with determinant +1, or for a quaternion whose
        length is not 1.
    """
    if value is None:
        return np.eye(3)
    if to_array(value, "rotation").shape == (4,):
        quaternion = as_array(value, "rotation", (4,), "quaternion x, y, z, w")
        length = length_of(quaternion)
        _require_unit(np.array([length]), "rotation")
        return np.array(turning_rows(*(quaternion / length).tolist()))
    matrix = as_array(value, "rotation", (3, 3), "or quaternion of shape (4,)")
    return np.asarray(_rotations(matrix[None], "rotation")[0])


def as_rotations(value: Any, name: str) -> Floats:
    """Convert matrices (m, 3, 3) or quaternions (m, 4) of x, y, z, w to rotation matrices (m, 3, 3).

    Raises: OptionError with the first invalid rotation.
    """
    if to_array(value, name).ndim == 2:
        return _from_quaternions(as_array(value, name, (None, 4), "quaternions x, y, z, w"), name)
    return _rotations(as_array(value, name, (None, 3, 3), "or quaternions of shape (n, 4)"), name)


def _rotations(matrices: Floats, name: str) -> Floats:
    bad = np.abs(matrices).max(axis=(1, 2), initial=0.0) > 2.0  # reject early: a product could overflow
    sound = matrices[~bad]
    gap = np.abs(sound @ np.swapaxes(sound, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad[~bad] = (gap > 1e-5) | (np.linalg.det(sound) < 0)
    if bad.any():
        raise OptionError(
            f"{name}{_which(bad)} must be an orthonormal matrix with determinant +1, "
            f"got {matrices[bad.argmax()].round(6).tolist()}"
        )
    return matrices


def _from_quaternions(quaternions: Floats, name: str) -> Floats:
    lengths = np.linalg.norm(quaternions, axis=1)
    _require_unit(lengths, name)
    return np.moveaxis(np.array(turning_rows(*(quaternions / lengths[:, None]).T)), 2, 0)


def _require_unit(lengths: Floats, name: str) -> None:
    bad = np.abs(lengths - 1.0) > 1e-3
    if bad.any():
        raise OptionError(
            f"{name}{_which(bad)} is a quaternion of length {lengths[bad.argmax()]:g}: normalise it"
        )


def _which(bad: NDArray[np.bool_]) -> str:
    return f" {int(bad.argmax())}" if len(bad) > 1 else ""
