"""From a world's axes to those of glTF."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def y_up(rows: NDArray[Any]) -> NDArray[Any]:
    """Vectors (n, 3) of a world, in which z is up, as glTF has them: (x, z, -y). No bit is lost."""
    return np.stack([rows[:, 0], rows[:, 2], -rows[:, 1]], axis=1)
