"""Coordinate axes of the engines for which a world can be exported."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import OptionError

Floats = NDArray[np.float64]

AXES = {
    "z-up": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "y-up": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "unity": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "unreal": ((100, 0, 0), (0, -100, 0), (0, 0, 100)),
}
"""Matrices by name. Each matrix converts positions in this package [m] (z up, right-handed) to positions in
the engine.

"z-up": unchanged, for Blender and Panda3D. "y-up": y up, right-handed, for Godot, glTF and three.js. "unity":
y up, left-handed. "unreal": z up, left-handed, in centimetres.
"""


def axes_of(name: str) -> Floats:
    """Return the matrix (3, 3) for a name in `AXES`. Raises: OptionError for any other name."""
    if name not in AXES:
        raise OptionError(f"axes must be one of {', '.join(AXES)}, got {name!r}")
    return np.array(AXES[name], dtype=np.float64)
