"""Find the tiles of an image that can show a shadow on the floor.

In all other tiles, the floor is copied from the backdrop.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.render.kernel_types import TILE


class FloorTiles:
    """Area of the floor that is visible in each tile of an image, computed once per camera.

    Args:
        rays: matrix (3, 3) that maps (u, v, 1) to the direction through a pixel.
        eye: position of the camera [m].
        floor: height of the floor [m], or None.
    """

    def __init__(
        self,
        width: int,
        height: int,
        rays: NDArray[np.float64],
        eye: NDArray[np.float64],
        floor: float | None,
    ) -> None:
        top, left = np.meshgrid(np.arange(0, height, TILE), np.arange(0, width, TILE), indexing="ij")
        corners = np.stack([left, top, np.ones_like(left)], axis=-1).reshape(-1, 1, 3)
        corners = corners + TILE * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)])
        directions = corners @ rays.T  # (tiles, 4, 3)
        down = directions[..., 2] < -1e-6
        sees_floor = floor is not None and eye[2] > floor
        # A tile that contains the horizon shows an unbounded area, so it counts as shadowed by every shadow.
        self._unbounded = down.any(axis=1) & ~down.all(axis=1) & sees_floor
        self._bounded = down.all(axis=1) & sees_floor
        drop = (floor or 0.0) - eye[2]
        hits = eye + directions * (drop / np.minimum(directions[..., 2], -1e-6))[..., None]
        self._hits = np.concatenate([hits, np.ones_like(hits[..., :1])], axis=-1)

    def shadowed(self, maps: Sequence[tuple[NDArray[np.float32], NDArray[np.bool_]]]) -> NDArray[np.int32]:
        """Return 1 for tiles that can show a shadow, else 0, int32 (tiles,).

        Args:
            maps: pairs of a matrix (4, 4) from (x, y, z, 1) to texels, and the mask (n, n) of dark texels.
        """
        touched = np.zeros(len(self._hits), dtype=bool)
        for matrix, dark in maps:
            rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
            if len(rows) == 0:
                continue
            texels = self._hits @ matrix[:2].T.astype(np.float64)
            low, high = texels.min(axis=1), texels.max(axis=1)
            # The floor area of a tile is convex, so the corners of the area are sufficient. Interpolation
            # widens shadows by a texel.
            across = (low[:, 0] <= columns[-1] + 2) & (high[:, 0] >= columns[0] - 1)
            along = (low[:, 1] <= rows[-1] + 2) & (high[:, 1] >= rows[0] - 1)
            touched |= self._unbounded | (self._bounded & across & along)
        return touched.astype(np.int32)
