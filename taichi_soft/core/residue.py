"""NumPy computations with the same results on every processor.

Sums have a fixed order, and remaining round-off is removed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHARE = 1e-12
"""Fraction of the largest number below which a number counts as round-off."""


def rounded(value: float) -> float:
    """Round a result of iterations to five digits, which do not depend on round-off."""
    return float(f"{value:.5g}")


def without_residue(rows: Floats, axis: int | tuple[int, ...] = -1) -> Floats:
    """Replace numbers that are negligible relative to the largest one along some axes by zeros.

    NumPy's products and inverses round differently on different processors, so cancelled sums are 0 on one
    and 1e-17 on another, and 32-bit floats would keep the difference.
    """
    size = np.abs(rows).max(axis=axis, keepdims=True, initial=0.0)
    return np.where(np.abs(rows) > SHARE * size, rows, 0.0)


def weighted_sum(weights: Floats, rows: Floats) -> Floats:
    """Sum of rows (n, 3) times weights (n,), in a fixed order."""
    return np.asarray((weights[:, None] * rows).sum(axis=0))


def kept(rows: Floats) -> Floats:
    """Round numbers to 32-bit floats without residue, the form that a world stores."""
    return without_residue(rows).astype(np.float32).astype(np.float64)
