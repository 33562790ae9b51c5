"""Render soft bodies on the CPU, without a display or a graphics driver."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.checks import as_count, as_number
from taichi_soft.core.errors import OptionError
from taichi_soft.core.runtime import init, is_initialized, ti
from taichi_soft.render.backdrop import COLORS, Backdrop, BackdropName
from taichi_soft.render.backdrop_kernels import paint_backdrop
from taichi_soft.render.camera import Camera
from taichi_soft.render.colors import to_linear
from taichi_soft.render.drawn_surface import Surface
from taichi_soft.render.floor_tiles import FloorTiles
from taichi_soft.render.frame_arrays import SceneArrays
from taichi_soft.render.look import Look
from taichi_soft.render.occlusion import REACH, Occlusion
from taichi_soft.render.raster import NOTHING_BEHIND, ROTATED_GRID, Raster
from taichi_soft.render.shade_kernels import shade
from taichi_soft.render.shadows import ShadowMaps
from taichi_soft.render.tone import encode_table, light_table

LARGEST = 8192  # largest width and height [pixels]; sample indices of larger images would exceed 32 bits


class Renderer:
    """Draws surfaces with a warm key light and a cool fill, above a checked floor that fades to the horizon.

    Shadows are soft, nearby surfaces occlude ambient light, and tone mapping compresses bright tones, see
    `tone`.

    Args:
        width, height: size of the image, 16 to 8192 [pixels].
        camera: the camera; it can be replaced between frames. The sun starts over the left shoulder of the
            first camera and stays fixed in the world.
        floor: height of the floor [m], or None for no floor.
        check: edge of the floor's checks [m]; None chooses a round number from the camera's distance.
        backdrop: sky and floor, see `Backdrop`.
    Raises: OptionError for arguments out of range.

    The constructor starts Taichi on the CPU if it is not running, as a `World` does, and allocates the
    buffers. Kernels compile at the first frame. An image is bit-identical in every run and for any number of
    threads.
    """

    def __init__(
        self,
        width: int,
        height: int,
        *,
        camera: Camera,
        floor: float | None = 0.0,
        check: float | None = None,
        backdrop: Backdrop | BackdropName = Backdrop.DAY,
    ) -> None:
        self.width = as_count(width, "width", 16, LARGEST)
        self.height = as_count(height, "height", 16, LARGEST)
        self._floor = None if floor is None else as_number(floor, "floor", -1e6, 1e6)
        if not isinstance(camera, Camera):
            raise OptionError(f"camera must be a Camera, got {type(camera).__name__}")
        self._scale = camera.distance * math.tan(math.radians(camera.fov_degrees) / 2.0) * 2.0
        self.check = (
            _round_length(self._scale / 5.0) if check is None else as_number(check, "check", 1e-6, 1e6)
        )
        if not is_initialized():
            init()
        self._raster = Raster(self.width, self.height, ROTATED_GRID)
        self._shadows = ShadowMaps(camera, self.floor, self._scale)
        self._occlusion = Occlusion(self._raster, REACH * self._scale)
        self._backdrop = np.empty((self.height, self.width, 4), dtype=np.float32)
        self._plain = np.empty((self.height, self.width, 3), dtype=np.uint8)
        self._encode, self._light_of_byte = encode_table(), light_table()
        self._backdrop_colors = COLORS[Backdrop.parse(backdrop)]
        self._decode = to_linear(np.arange(256, dtype=np.float32) / 255.0)
        self._camera: Camera | None = None
        self.camera = camera

    @property
    def floor(self) -> float | None:
        """Height of the floor [m], or None."""
        return self._floor

    @property
    def camera(self) -> Camera:
        """Camera of the next image."""
        assert self._camera is not None
        return self._camera

    @camera.setter
    def camera(self, camera: Camera) -> None:
        if not isinstance(camera, Camera):
            raise OptionError(f"camera must be a Camera, got {type(camera).__name__}")
        if camera == self._camera:
            return
        self._camera = camera
        self._to_picture = np.vstack([camera.matrix(self.width, self.height), [0.0, 0.0, 0.0, 1.0]])
        rays = np.linalg.inv(self._to_picture[:3, :3])
        self._rays, self._lens = rays.astype(np.float32), self._to_picture[:3, :3].astype(np.float32)
        self._tiles = FloorTiles(self.width, self.height, rays, np.array(camera.eye), self.floor)
        colors = self._backdrop_colors
        paint_backdrop(
            self._rays,
            ti.Vector(camera.eye),
            ti.Vector(camera.target),
            self.floor or 0.0,
            int(self.floor is not None),
            self.check,
            3.0 * camera.distance,
            ti.Vector(colors.horizon),
            ti.Vector(colors.zenith),
            ti.Vector(colors.bright),
            ti.Vector(colors.dark),
            self._encode,
            self._backdrop,
            self._plain,
        )

    @property
    def sun(self) -> NDArray[np.float64]:
        """Unit vector to the sun, (3,)."""
        direction: NDArray[np.float64] = self._shadows.sun.copy()
        return direction

    def render(self, surfaces: Sequence[Surface]) -> NDArray[np.uint8]:
        """Render surfaces to a new image, sRGB, uint8 (height, width, 3).

        A jelly shows everything behind it except other jellies.
        Args:
            surfaces: surfaces at their current positions.
        Raises: OptionError for anything that is not a `Surface`.
        """
        scene = SceneArrays.of(surfaces)
        self._shadows.update(scene, self.camera)
        opaque = [surface for surface in surfaces if surface.look is not Look.JELLY]
        if len(opaque) == len(surfaces):
            return self._draw(scene, self._plain)
        return self._draw(scene, self._draw(SceneArrays.of(opaque), self._plain))

    def _draw(self, scene: SceneArrays, opaque: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Render a scene with the current shadow maps; `opaque` is the image behind jellies."""
        camera = self.camera
        behind = self._floor_depth()
        self._raster.draw(scene, self._to_picture, camera.near, behind, keep_empty_tiles=True)
        focal = min(self.width, self.height) / (2.0 * math.tan(math.radians(camera.fov_degrees) / 2.0))
        self._occlusion.update(self._rays, self._lens, focal, behind)
        picture = np.empty((self.height, self.width, 3), dtype=np.uint8)
        maps = self._shadows
        shade(
            self._rays,
            ti.Vector(camera.eye),
            ti.Vector(maps.sun),
            -1e6 if self.floor is None else self.floor,
            0.12 * self._scale,
            maps.matrix,
            maps.texel,
            maps.depth,
            maps.near_shadow,
            maps.far_shadow,
            maps.far_height,
            maps.contact,
            maps.contact_matrix,
            self._backdrop,
            self._plain,
            opaque,
            self._light_of_byte,
            scene.positions,
            scene.normals,
            scene.colors,
            scene.triangles,
            scene.looks,
            self._occlusion.depth,
            self._occlusion.hidden,
            scene.textures.uv,
            scene.textures.first_level,
            scene.textures.texels,
            scene.textures.levels,
            self._decode,
            self._raster.planes,
            self._raster.tile_begin,
            self._tiles.shadowed(maps.extents),
            self._raster.samples,
            self._raster.owner,
            self._encode,
            picture,
        )
        return picture

    def _floor_depth(self) -> tuple[float, float, float]:
        """Return the coefficients a, b and c of 1 / depth = a u + b v + c on the floor.

        The raster hides surfaces behind this plane.
        """
        if self.floor is None or self.camera.eye[2] <= self.floor:
            return NOTHING_BEHIND
        a, b, c = (float(x) / (self.floor - self.camera.eye[2]) for x in self._rays[2])
        return a, b, c


def _round_length(length: float) -> float:
    """Round a length down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length)
