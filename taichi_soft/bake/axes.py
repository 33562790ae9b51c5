"""Convert the axes of a world (z up) to the axes of glTF (y up)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def y_up(rows: NDArray[Any]) -> NDArray[Any]:
    """Convert vectors (n, 3) from z up to glTF's y up, without rounding: (x, y, z) becomes (x, z, -y)."""
    return np.stack([rows[:, 0], rows[:, 2], -rows[:, 1]], axis=1)
