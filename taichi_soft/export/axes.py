"""Axes of the engines that a world may be exported for."""

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
"""By name, what turns a place of ours [m], z up and right-handed, into one of the host's, row by row.

"z-up": as ours, for Blender, Panda3D. "y-up": right-handed, for Godot, glTF, three.js. "unity": y up,
left-handed. "unreal": z up, left-handed, centimetres.
"""


def axes_of(name: str) -> Floats:
    """(3, 3). Raises: OptionError for a name that is not in `AXES`."""
    if name not in AXES:
        raise OptionError(f"axes must be one of {', '.join(AXES)}, got {name!r}")
    return np.array(AXES[name], dtype=np.float64)
