"""Shadow maps of a frame: one map seen from the sun, and one seen from the floor upwards."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from taichi_soft.render.camera import Camera
from taichi_soft.render.frame_arrays import SceneArrays
from taichi_soft.render.light_funcs import COARSE as COARSE_TEXELS
from taichi_soft.render.light_funcs import FAINTEST
from taichi_soft.render.lighting import SUN_AZIMUTH, SUN_ELEVATION
from taichi_soft.render.opencv import cv2
from taichi_soft.render.raster import CENTER, Raster

COARSE = int(COARSE_TEXELS)
SIZE = 384  # texels per side of the sun's shadow map
CONTACT_SIZE = 192  # texels per side of the contact map, seen from the floor
# Lengths as fractions of the size of the scene. NEAR_BLUR: blur of shadows cast from just above the floor.
# FAR_BLUR: blur of shadows cast from high above the floor. FAR_HEIGHT: height from which shadows have this
# blur. CONTACT_BLUR: blur of contact shadows. CONTACT_HEIGHT: height of an occluder at which the strength of
# its contact shadow is 1 / e.
NEAR_BLUR, FAR_BLUR, FAR_HEIGHT = 0.006, 0.032, 0.3
CONTACT_BLUR, CONTACT_HEIGHT = 0.016, 0.05
# Largest depth below the floor at which surfaces cast shadows on the floor, as a fraction of the size of the
# scene.
SUNK = 0.05
# Largest distance from the camera's target at which bodies cast shadows, as a multiple of the distance
# between camera and target. Without this limit, a body that flies away would stretch the map.
WITHIN = 3.0

Floats = NDArray[np.float32]


class ShadowMaps:
    """Shadow maps of the sun and of contact with the floor, allocated once.

    The sun's map has only faces turned away from the sun, so that a body never shadows its own lit side.
    Shadows on the floor are blurred copies of this map.

    Attributes:
        sun: unit vector to the sun.
        matrix: float32 (4, 4), maps (x, y, z, 1) to texel column and row, 1 and height towards the sun [m].
        texel: edge of a texel [m].
        depth: float32 (SIZE * SIZE,), height towards the sun of the uppermost back face [m].
        near_shadow: float32 (SIZE, SIZE), shadow of occluders just above the floor, 0 to 1.
        far_shadow: float32 (SIZE / COARSE, SIZE / COARSE), shadow of occluders high above the floor, 0 to 1.
        far_height: float32 with the shape of `far_shadow`, `far_shadow` times the height of the occluders,
            in units of FAR_HEIGHT.
        contact_matrix: like `matrix`, for the map seen from the floor upwards.
        contact: float32 (CONTACT_SIZE, CONTACT_SIZE), strength of contact shadows, 0 to 1.
    """

    def __init__(self, camera: Camera, floor: float | None, scale: float) -> None:
        """Allocate the maps; `scale` is the size of the scene [m]."""
        self._floor, self._scale = floor, scale
        outward = np.subtract(camera.eye, camera.target)
        azimuth = math.atan2(outward[1], outward[0]) - SUN_AZIMUTH
        flat = math.cos(SUN_ELEVATION)
        self.sun = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(SUN_ELEVATION)])
        right = np.array([-self.sun[1], self.sun[0], 0.0]) / flat
        self._axes = np.array([right, np.cross(self.sun, right), self.sun])
        self._raster = Raster(SIZE, SIZE, CENTER)
        self._contact_raster = Raster(CONTACT_SIZE, CONTACT_SIZE, CENTER)
        coarse = SIZE // COARSE
        self.near_shadow: Floats = np.zeros((SIZE, SIZE), dtype=np.float32)
        self.far_shadow: Floats = np.zeros((coarse, coarse), dtype=np.float32)
        self.far_height: Floats = np.zeros((coarse, coarse), dtype=np.float32)
        self.contact: Floats = np.zeros((CONTACT_SIZE, CONTACT_SIZE), dtype=np.float32)
        self.matrix = self.contact_matrix = np.eye(4, dtype=np.float32)
        self.texel = 1.0

    @property
    def depth(self) -> Floats:
        """Depth map of the sun, see `ShadowMaps`."""
        return self._raster.depth

    def update(self, scene: SceneArrays, camera: Camera) -> None:
        """Compute the maps of a scene."""
        away = np.abs(scene.positions - np.array(camera.target)).max(axis=1)
        bodies = scene.positions[away < WITHIN * camera.distance]
        if len(bodies) == 0 or scene.is_empty:
            for shadow in (self.near_shadow, self.far_shadow, self.far_height, self.contact):
                shadow[:] = 0.0
            return
        matrix, self.texel = _fit(self._axes, bodies, SIZE, FAR_BLUR * self._scale)
        self._raster.draw(scene, matrix, None)
        self.matrix = matrix.astype(np.float32)
        if self._floor is not None:
            self._spread_sun(self._floor)
            self._spread_contact(self._floor, scene, bodies)

    def _spread_sun(self, floor: float) -> None:
        """Blur the sun's map to get the floor's shadows."""
        # Rows of texels are horizontal, so the floor has the same height towards the sun along a row.
        down = (np.arange(0.5, SIZE)[:, None] - self.matrix[1, 3]) * self.texel
        height = self._raster.depth.reshape(SIZE, SIZE) - (floor - down * self._axes[1, 2]) / self.sun[2]
        height *= self.sun[2] / (FAR_HEIGHT * self._scale)
        covered = (height > -SUNK / FAR_HEIGHT).astype(np.float32)
        high = (np.maximum(height, 0.0) * covered).astype(np.float32)
        small = (SIZE // COARSE, SIZE // COARSE)
        share, high = (cv2.resize(fine, small, interpolation=cv2.INTER_AREA) for fine in (covered, high))
        blur = max(FAR_BLUR * self._scale / (self.texel * COARSE), 0.8)
        self.near_shadow = _blurred(covered, max(NEAR_BLUR * self._scale / self.texel, 1.2))
        self.far_shadow, self.far_height = _blurred(share, blur), _blurred(high, blur)

    def _spread_contact(self, floor: float, scene: SceneArrays, bodies: Floats) -> None:
        """Compute the contact shadow from the height of the lowest surface above each texel of the floor."""
        blur = CONTACT_BLUR * self._scale
        matrix, texel = _fit(np.diag([1.0, 1.0, -1.0]), bodies, CONTACT_SIZE, blur)
        self._contact_raster.draw(scene, matrix, None)
        self.contact_matrix = matrix.astype(np.float32)
        height = (-self._contact_raster.depth.reshape(CONTACT_SIZE, -1) - floor) / self._scale
        closeness = np.exp(-np.clip(height / CONTACT_HEIGHT, 0.0, 30.0))
        self.contact = _blurred(np.where(height > -SUNK, closeness, 0.0), blur / texel)

    @property
    def extents(self) -> list[tuple[Floats, NDArray[np.bool_]]]:
        """Regions of the floor that can be dark.

        Each region is a matrix (4, 4) from (x, y, z, 1) to texels, and a mask of dark texels.
        """
        coarse = (self.matrix / np.array([[COARSE], [COARSE], [1.0], [1.0]])).astype(np.float32)
        return [(coarse, self.far_shadow > FAINTEST), (self.contact_matrix, self.contact > FAINTEST)]


def _fit(
    axes: NDArray[np.float64], points: NDArray[np.floating], size: int, blur: float
) -> tuple[NDArray[np.float64], float]:
    """Return the matrix (4, 4) of a (size, size) map that contains `points`, and the edge of a texel [m].

    The line of sight is opposite to the last of `axes`. Texel sizes change in steps and texels are fixed in
    the world, so that shadows do not crawl while a body moves. The map has a border of three times
    `blur` around the points.
    """
    seen = points @ axes[:2].T.astype(np.float32)
    low, high = seen.min(axis=0) - 3.0 * blur, seen.max(axis=0) + 3.0 * blur
    texel = 2.0 ** (math.ceil(4.0 * math.log2(float((high - low).max()) / (size - 4))) / 4.0)
    corner = np.floor((low + high) / 2.0 / texel) - size // 2
    matrix = np.zeros((4, 4))
    matrix[:2, :3] = axes[:2] / texel
    matrix[:2, 3] = -corner
    matrix[2, 3] = 1.0
    matrix[3, :3] = axes[2]
    return matrix, texel


def _blurred(values: NDArray[np.floating], sigma: float) -> Floats:
    blurred: Floats = cv2.GaussianBlur(
        values.astype(np.float32), (0, 0), sigma, borderType=cv2.BORDER_REPLICATE
    )
    return blurred
