"""Check and copy the arrays that callers pass."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.errors import MeshError, OptionError

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int32]

# Largest coordinate [m]. Products of three lengths stay far below the largest float64 number, 1.8e308.
LARGEST_COORDINATE = 1e30

MAX_TETS = 10_000_000
"""Largest number of tetrahedra in a built-in shape. A larger shape would take minutes to build, and tens of
gigabytes of memory."""


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Make an array C-contiguous and read-only. The array is copied only if it is not C-contiguous."""
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array


def _as_array(values: ArrayLike, name: str) -> NDArray[Any]:
    try:
        return np.array(values)
    except (ValueError, TypeError) as error:
        raise MeshError(f"{name} is not a rectangular array of numbers ({error})") from None


def as_real(values: ArrayLike, name: str, shape: tuple[int | None, ...], element: str) -> FloatArray:
    """Check an array of real numbers and return a float64 copy.

    Args:
        values: array to check.
        name: name of the array in messages.
        shape: required shape; None allows any length.
        element: name of a row in messages.
    Raises: MeshError for an empty array, a wrong shape or dtype, or a number that is not finite.
    """
    array = _as_array(values, name)
    expected = "(" + ", ".join("n" if length is None else str(length) for length in shape) + ")"
    if array.size == 0:
        raise MeshError(f"{name} is empty (shape {array.shape}): pass an array of shape {expected}")
    if array.dtype.kind not in "fiu":
        raise MeshError(f"{name} has dtype {array.dtype}: pass real numbers")
    if array.ndim != len(shape) or any(
        want not in (None, got) for want, got in zip(shape, array.shape, strict=True)
    ):
        raise MeshError(f"{name} has shape {array.shape}: pass an array of shape {expected}")
    real = array.astype(np.float64)
    bad = ~np.isfinite(real).reshape(len(real), -1).all(axis=1)
    if bad.any():
        row = int(np.argmax(bad))
        raise MeshError(f"{element} {row} is {real[row].tolist()}: every number must be finite")
    return real


def as_points(values: ArrayLike, name: str = "vertices", dimension: int = 3) -> FloatArray:
    """Check points and return a float64 copy of shape (n, dimension) [m].

    Raises: MeshError for a wrong shape or dtype, or a coordinate that is not finite or above
        `LARGEST_COORDINATE`.
    """
    points = as_real(values, name, (None, dimension), "vertex")
    far = np.abs(points).max(axis=1) > LARGEST_COORDINATE
    if far.any():
        row = int(np.argmax(far))
        raise MeshError(
            f"vertex {row} is {points[row].tolist()}: coordinates must lie within {LARGEST_COORDINATE:g} m"
        )
    return points


def as_indices(
    values: ArrayLike, name: str, width: int, vertex_count: int, element: str, *, may_repeat: bool = False
) -> IntArray:
    """Check vertex indices from 0 to vertex_count - 1 and return an int32 copy of shape (m, width).

    Raises: MeshError for an empty array, a wrong shape or dtype, an index out of range, or (unless
        `may_repeat`) a row that names a vertex twice. The message calls a row `element`.
    """
    array = _as_array(values, name)
    if array.size == 0:
        raise MeshError(f"{name} is empty (shape {array.shape}): a mesh needs at least one {element}")
    if array.dtype.kind not in "iu":
        raise MeshError(f"{name} has dtype {array.dtype}: pass integer vertex indices")
    if array.ndim != 2 or array.shape[1] != width:
        raise MeshError(f"{name} has shape {array.shape}: pass an array of shape (m, {width})")
    outside = ((array < 0) | (array >= vertex_count)).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise MeshError(
            f"{element} {row} names vertices {name_vertices(array[row])}, but there are {vertex_count} of "
            f"them: indices run from 0 to {vertex_count - 1}"
        )
    ordered = np.sort(array, axis=1)
    repeated = (ordered[:, 1:] == ordered[:, :-1]).any(axis=1)
    if repeated.any() and not may_repeat:
        row = int(np.argmax(repeated))
        raise MeshError(
            f"{element} {row} names a vertex twice (vertices {name_vertices(array[row])}): repair or "
            "remove it"
        )
    return array.astype(np.int32)


def require_tet_count(tets: int) -> None:
    """Check the number of tetrahedra of a shape. Raises: OptionError if it is above `MAX_TETS`."""
    if tets > MAX_TETS:
        raise OptionError(f"the shape would have {tets:,} tetrahedra: make it coarser, at most {MAX_TETS:,}")


def name_vertices(indices: NDArray[Any]) -> str:
    """Format the vertex indices of one element for a message, for example `4, 9, 2, 31`."""
    return ", ".join(str(int(index)) for index in indices)
