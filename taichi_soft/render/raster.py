"""Raster of an image: visible triangle and depth of each sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.runtime import ti
from taichi_soft.render.frame_arrays import SceneArrays
from taichi_soft.render.geometry_kernels import PLANE, project_triangles
from taichi_soft.render.kernel_types import TILE, matrix
from taichi_soft.render.raster_kernels import rasterize

# Positions of the samples of a pixel relative to its centre [pixels]. CENTER: one sample. ROTATED_GRID: four
# samples, of which no two are in the same row or column. This grid is best for smoothing edges that are
# nearly vertical or nearly horizontal.
CENTER = np.zeros((1, 2), dtype=np.float32)
ROTATED_GRID = np.array([(-1, -3), (3, -1), (-3, 1), (1, 3)], dtype=np.float32) / 8.0

NO_LIMIT = 1e30
NOTHING_BEHIND = (0.0, 0.0, -NO_LIMIT)


class Raster:
    """Finds the visible triangle and the depth of each sample of an image.

    The buffers are allocated once. The lists of triangles grow with the scene.

    Attributes:
        depth: float32 (height * width * samples,), q of the visible triangle, see `project_triangles`.
        owner: int32 of the same length, index of the visible triangle or -1.
        planes: float32 (m, 12), edges and depth of the triangles of the last `draw`.
        tile_begin: int32 (tiles + 1,), entry i is the number of triangles in tiles 0 to i - 1. After `draw`
            with `keep_empty_tiles`, `depth` and `owner` are valid only in tiles with triangles.
    """

    def __init__(self, width: int, height: int, samples: NDArray[np.float32]) -> None:
        self.width, self.height, self.samples = width, height, samples
        tiles = -(-width // TILE) * -(-height // TILE)
        self.depth = np.zeros(width * height * len(samples), dtype=np.float32)
        self.owner = np.full(width * height * len(samples), -1, dtype=np.int32)
        self.tile_begin = np.zeros(tiles + 1, dtype=np.int32)
        self._tile_next = np.zeros(tiles, dtype=np.int32)
        self._tile_triangles = np.zeros(1024, dtype=np.int32)
        self.planes = np.zeros((1, PLANE), dtype=np.float32)
        self._boxes = np.zeros((1, 4), dtype=np.int32)

    def draw(
        self,
        scene: SceneArrays,
        to_picture: NDArray[np.float64],
        near: float | None,
        backdrop: tuple[float, float, float] = NOTHING_BEHIND,
        *,
        keep_empty_tiles: bool = False,
    ) -> None:
        """Find the visible triangle of each sample.

        Args:
            to_picture: (4, 4), see `project_triangles`.
            near: smallest depth drawn [m]; None for an orthographic projection, where every depth is 1.
            backdrop: coefficients of the plane q = a u + b v + c. The plane hides everything behind it.
            keep_empty_tiles: do not clear tiles without triangles, to save time.
        """
        if len(self.planes) != len(scene.triangles):
            self.planes = np.zeros((len(scene.triangles), PLANE), dtype=np.float32)
            self._boxes = np.zeros((len(scene.triangles), 4), dtype=np.int32)
        entries = project_triangles(
            matrix(to_picture.tolist()),
            near or 0.5,
            self.width,
            self.height,
            scene.positions,
            scene.triangles,
            self.planes,
            self._boxes,
            self.tile_begin,
        )
        if entries > len(self._tile_triangles):
            self._tile_triangles = np.zeros(2 * entries, dtype=np.int32)
        rasterize(
            self.width,
            self.height,
            self.samples,
            ti.Vector(backdrop),
            NO_LIMIT if near is None else 1.0 / near,
            0 if keep_empty_tiles else 1,
            self.planes,
            self._boxes,
            self.tile_begin,
            self._tile_next,
            self._tile_triangles,
            self.depth,
            self.owner,
        )
