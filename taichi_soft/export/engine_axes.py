"""Axes of the engines that a world can be exported for."""

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
"""By name: matrix from our positions [m], z up and right-handed, to the engine's.

"z-up": ours, for Blender, Panda3D. "y-up": right-handed, for Godot, glTF, three.js. "unity": y up,
left-handed. "unreal": z up, left-handed, centimetres.
"""


def axes_of(name: str) -> Floats:
    """Return the matrix (3, 3) of a name. Raises: OptionError for a name that is not in `AXES`."""
    if name not in AXES:
        raise OptionError(f"axes must be one of {', '.join(AXES)}, got {name!r}")
    return np.array(AXES[name], dtype=np.float64)
