"""NumPy computations with the same results on every processor.

Sums have a fixed order, and residues of rounding are set to zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SHARE = 1e-12
"""Numbers below this fraction of the largest number count as rounding errors and are set to zero."""


def rounded(value: float) -> float:
    """Round the result of an iteration to five digits. Rounding errors affect only later digits."""
    return float(f"{value:.5g}")


def rounding_error(x: Floats) -> Floats:
    """Return the part of numbers that float32 cannot store."""
    return np.asarray(x - x.astype(np.float32))


def without_residue(rows: Floats, axis: int | tuple[int, ...] = -1) -> Floats:
    """Set to zero all numbers that are negligible relative to the largest number along `axis`.

    NumPy's products and inverses round differently on different processors. A sum that cancels can be 0 on
    one processor and 1e-17 on another, and 32-bit floats would preserve this difference.
    """
    size = np.abs(rows).max(axis=axis, keepdims=True, initial=0.0)
    return np.where(np.abs(rows) > SHARE * size, rows, 0.0)


def weighted_sum(weights: Floats, rows: Floats) -> Floats:
    """Return the weighted sum of rows (n, 3), a vector (3,). The order of the additions is fixed."""
    return np.asarray((weights[:, None] * rows).sum(axis=0))


def kept(rows: Floats) -> Floats:
    """Set rounding residues to zero, and round all numbers to 32-bit floats, as a world stores them."""
    return without_residue(rows).astype(np.float32).astype(np.float64)
