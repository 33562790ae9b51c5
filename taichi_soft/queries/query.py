"""Helpers that all queries share: checks of arguments, and the layout of results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_number
from taichi_soft.core.errors import OptionError

Floats = NDArray[np.float64]

_UNLIMITED = 3e38
"""Largest distance [m] or squared distance [m^2]. It replaces infinity, which the kernels do not handle."""


def as_max_distance(max_distance: float) -> float:
    """Return `max_distance` [m] if it is above 0 or infinite. Raises: OptionError otherwise."""
    if isinstance(max_distance, (float, np.floating)) and max_distance == math.inf:
        return math.inf
    limit = as_number(max_distance, "max_distance", 0.0, math.inf, "a number above 0 m, or infinity")
    if limit == 0.0:
        raise OptionError("max_distance must be a number above 0 m, or infinity, got 0")
    return limit


def next_above(limit: float) -> float:
    """Return the next float32 above `limit`.

    Kernels accept only distances below the limit that they get, but a distance equal to `limit` is valid.
    """
    return float(np.nextafter(np.float32(min(limit, _UNLIMITED)), np.float32(np.inf)))


def as_body_indices(
    bodies: Iterable[SoftBody] | None, handles: Sequence[SoftBody | None]
) -> NDArray[np.int32]:
    """Return the indices of the bodies to test, ascending; None selects all bodies. Raises: OptionError.

    Args: handles: the body in each slot, None for an empty slot.
    """
    if bodies is None:
        return np.array([body.index for body in handles if body is not None], dtype=np.int32)
    try:
        requested = list(bodies)
    except TypeError:
        raise OptionError(f"bodies must be a list of this world's bodies or None, got {bodies!r}") from None
    chosen = set()
    for body in requested:
        index = getattr(body, "index", None)
        if not isinstance(index, int) or not 0 <= index < len(handles) or handles[index] is not body:
            raise OptionError(f"bodies must be a list of this world's bodies or None, but one is {body!r}")
        chosen.add(index)
    return np.array(sorted(chosen), dtype=np.int32)


def unpack_result(row: NDArray[np.float32]) -> tuple[int, int, float, Floats, Floats, Floats]:
    """Unpack body, face, distance, weights, point and normal from a row of `write_result`."""
    real = row.astype(np.float64)
    return int(real[10]), int(real[11]), float(real[0]), real[1:4], real[4:7], real[7:10]
