"""What NumPy finds, the same on every processor: sums in one order, and without what is but round-off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHARE = 1e-12
"""Of the largest number, below which one is taken for round-off."""


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
    """With the digits of a 32-bit float, and without residue: for what a world remembers in more digits."""
    return without_residue(rows).astype(np.float32).astype(np.float64)
