"""Numbers that NumPy computes alike on every processor.

Sums are made in one order. Where round-off remains, it is cut off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHARE = 1e-12
"""Share of the largest number: we take what is smaller for round-off."""


def rounded(value: float) -> float:
    """A number found by iterations, to five digits: those that do not depend on round-off."""
    return float(f"{value:.5g}")


def without_residue(rows: Floats, axis: int | tuple[int, ...] = -1) -> Floats:
    """Numbers, with zeros for those that are nothing beside the largest along some axes.

    NumPy's products and inverses round in another order on another processor, so that what cancels is 0 here
    and 1e-17 there. A 32-bit float keeps all digits of both.
    """
    size = np.abs(rows).max(axis=axis, keepdims=True, initial=0.0)
    return np.where(np.abs(rows) > SHARE * size, rows, 0.0)


def weighted_sum(weights: Floats, rows: Floats) -> Floats:
    """Sum of rows (n, 3), each times its weight (n,), made in one order."""
    return np.asarray((weights[:, None] * rows).sum(axis=0))


def kept(rows: Floats) -> Floats:
    """Numbers rounded to 32-bit floats, without residue. A world remembers such ones."""
    return without_residue(rows).astype(np.float32).astype(np.float64)
