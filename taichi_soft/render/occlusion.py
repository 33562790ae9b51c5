"""Screen-space ambient occlusion between bodies and colliders, computed for each frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.runtime import ti
from taichi_soft.render.occlusion_kernels import find_hidden, gather_depth, spiral_taps, spread_hidden
from taichi_soft.render.raster import Raster

Floats = NDArray[np.float32]

REACH = 0.06
"""Distance within which surfaces occlude each other, as a fraction of the size of the scene."""


class Occlusion:
    """Ambient occlusion of an image, computed at half its resolution.

    The buffers are allocated once. Surfaces that are outside the image or hidden do not occlude.

    Attributes:
        depth: float32 (height / 2, width / 2), 1 / depth of the visible surface [1/m].
        hidden: float32, with the shape of `depth`, occluded fraction of the surroundings, 0 to 1. The values
            are valid only in tiles with triangles.
    """

    def __init__(self, raster: Raster, reach: float) -> None:
        """Allocate the buffers; `reach` is the radius of occlusion [m]."""
        self._raster, self._reach = raster, reach
        shape = (raster.height + 1) // 2, (raster.width + 1) // 2
        self.depth: Floats = np.zeros(shape, dtype=np.float32)
        self.hidden: Floats = np.zeros(shape, dtype=np.float32)
        self._taps = spiral_taps()
        self._rough: Floats = np.zeros(shape, dtype=np.float32)

    def update(self, rays: Floats, lens: Floats, focal: float, backdrop: tuple[float, float, float]) -> None:
        """Compute the occlusion of the image in the raster.

        Args:
            rays: matrix (3, 3) from (u, v, 1) to the direction through a pixel.
            lens: inverse of `rays`.
            focal: focal length [pixels].
            backdrop: coefficients a, b and c of 1 / depth = a u + b v + c on the floor.
        """
        raster = self._raster
        count = len(raster.samples)
        u, v = (float(x) for x in raster.samples[0])
        gather_depth(
            raster.width, count, ti.Vector(backdrop), u, v, raster.tile_begin, raster.depth, self.depth
        )
        find_hidden(
            raster.width,
            count,
            rays,
            lens,
            focal,
            u,
            v,
            self._reach,
            raster.tile_begin,
            raster.owner,
            raster.planes,
            self._taps,
            self.depth,
            self._rough,
        )
        spread_hidden(raster.width, raster.tile_begin, self.depth, self._rough, self.hidden)
