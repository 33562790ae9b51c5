"""Convert a world's axes to those of glTF."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def y_up(rows: NDArray[Any]) -> NDArray[Any]:
    """Convert vectors (n, 3) from z up to glTF's y up: (x, z, -y). This is exact."""
    return np.stack([rows[:, 0], rows[:, 2], -rows[:, 1]], axis=1)
