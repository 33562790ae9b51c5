"""What all queries share: limits of distance, the bodies asked, and how kernels write an answer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.soft_body import SoftBody
from taichi_soft.core.checks import as_number
from taichi_soft.core.errors import OptionError

Floats = NDArray[np.float64]

_ENDLESS = 3e38
"""Stands for no limit [m or m^2]: kernels need not know infinity."""


def as_reach(max_distance: float) -> float:
    """A distance above 0; infinity stays what it is. Raises: OptionError."""
    if isinstance(max_distance, (float, np.floating)) and max_distance == math.inf:
        return math.inf
    reach = as_number(max_distance, "max_distance", 0.0, math.inf, "a number above 0 m, or infinity")
    if reach == 0.0:
        raise OptionError("max_distance must be a number above 0 m, or infinity, got 0")
    return reach


def just_beyond(limit: float) -> float:
    """The least float32 above: kernels take what is nearer, and the limit itself still counts."""
    return float(np.nextafter(np.float32(min(limit, _ENDLESS)), np.float32(np.inf)))


def as_chosen(bodies: Iterable[SoftBody] | None, handles: Sequence[SoftBody | None]) -> NDArray[np.int32]:
    """Indices of the bodies asked, ascending; all for None. Raises: OptionError.

    `handles`: the body in each slot, None where there is none.
    """
    if bodies is None:
        return np.array([body.index for body in handles if body is not None], dtype=np.int32)
    try:
        asked = list(bodies)
    except TypeError:
        raise OptionError(f"bodies must be a list of this world's bodies or None, got {bodies!r}") from None
    chosen = set()
    for body in asked:
        index = getattr(body, "index", None)
        if not isinstance(index, int) or not 0 <= index < len(handles) or handles[index] is not body:
            raise OptionError(f"bodies must be a list of this world's bodies or None, but one is {body!r}")
        chosen.add(index)
    return np.array(sorted(chosen), dtype=np.int32)


def read_answer(row: NDArray[np.float32]) -> tuple[int, int, float, Floats, Floats, Floats]:
    """SoftBody, face, distance, weights, point and normal."""
    real = row.astype(np.float64)
    return int(real[10]), int(real[11]), float(real[0]), real[1:4], real[4:7], real[7:10]
