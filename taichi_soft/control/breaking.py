"""Forces at which joints and attachments break."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_number
from taichi_soft.core.errors import OptionError

MOST_FORCE = 1e20
"""Largest force at which a joint or an attachment can break [N]."""


def as_break_force(force: Any) -> float | None:
    """Return the force at which a joint or an attachment breaks, as float32 [N]; None for never.

    Raises: OptionError for a number out of range.
    """
    if force is None:
        return None
    limit = as_number(force, "break_force", 0.0, MOST_FORCE, "a force above 0 N, or None")
    rounded = float(np.float32(limit))
    if rounded == 0.0:
        raise OptionError(f"break_force must be a force above 0 N, or None to never break, got {force!r}")
    return rounded


def exceeds(impulse: NDArray[np.float64], limit: float, dt: float) -> bool:
    """True if the mean force of an impulse (3,) [N s] in a step of `dt` [s] is above `limit` [N]."""
    x, y, z = impulse.tolist()
    return bool(x * x + y * y + z * z > (limit * dt) * (limit * dt))
