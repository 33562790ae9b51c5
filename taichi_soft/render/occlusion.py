"""Where bodies and colliders come close they take light from each other: found anew in every picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.runtime import ti
from taichi_soft.render.occlusion_kernels import find_hidden, gather_depth, spiral_taps, spread_hidden
from taichi_soft.render.raster import Raster

Floats = NDArray[np.float32]

REACH = 0.06
"""How far what stands in the way takes light [size of the scene]."""


class Occlusion:
    """How much each second pixel that shows a body sees of its surroundings, allocated once.

    What is outside the picture, or behind what is seen in it, takes no light.

    Attributes:
        depth: float32 (height / 2, width / 2), 1 / depth of what is seen [1/m].
        hidden: float32 of the same shape, share of the surroundings that is hidden, 0 to 1. Only what lies in
            tiles with triangles is up to date.
    """

    def __init__(self, raster: Raster, reach: float) -> None:
        """`reach`: how far what stands in the way takes light [m]."""
        self._raster, self._reach = raster, reach
        shape = (raster.height + 1) // 2, (raster.width + 1) // 2
        self.depth: Floats = np.zeros(shape, dtype=np.float32)
        self.hidden: Floats = np.zeros(shape, dtype=np.float32)
        self._taps = spiral_taps()
        self._rough: Floats = np.zeros(shape, dtype=np.float32)

    def update(self, rays: Floats, lens: Floats, focal: float, backdrop: tuple[float, float, float]) -> None:
        """Look at the picture that the raster holds.

        Args:
            rays: (3, 3), takes (u, v, 1) to the direction through a pixel; `lens` is its inverse.
            focal: pixels per unit of tangent.
            backdrop: plane of 1 / depth of the floor over the picture.
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
