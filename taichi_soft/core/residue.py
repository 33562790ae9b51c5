"""NumPy computations with the same results on every processor.

Sums have a fixed order, and residues of rounding are set to zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHARE = 1e-12
"""Fraction of the largest number below which a number counts as rounding."""


def rounded(value: float) -> float:
    """Round the result of an iteration to five digits, which do not depend on rounding errors."""
    return float(f"{value:.5g}")


def without_residue(rows: Floats, axis: int | tuple[int, ...] = -1) -> Floats:
    """Replace numbers that are negligible relative to the largest number along `axis` by zeros.

    NumPy's products and inverses round differently on different processors. A sum that cancels can be 0 on
    one processor and 1e-17 on another, and 32-bit floats would preserve this difference.
    """
    size = np.abs(rows).max(axis=axis, keepdims=True, initial=0.0)
    return np.where(np.abs(rows) > SHARE * size, rows, 0.0)


def weighted_sum(weights: Floats, rows: Floats) -> Floats:
    """Return the sum of rows (n, 3) times weights (n,), added in a fixed order."""
    return np.asarray((weights[:, None] * rows).sum(axis=0))


def kept(rows: Floats) -> Floats:
    """Round numbers to 32-bit floats without residue, as numbers are stored in a world."""
    return without_residue(rows).astype(np.float32).astype(np.float64)
