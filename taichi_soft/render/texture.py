"""Textures of surfaces, and flat arrays of the textures of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.core.checks import to_array
from taichi_soft.core.errors import OptionError
from taichi_soft.render.colors import to_linear, to_srgb

LARGEST = 16384
"""Largest edge of a texture [pixels]."""

LEVEL = 4
"""Number of entries per mip level: index of the first texel, width, height, and number of smaller levels that
follow."""


class Texture:
    """A texture with its mipmap. The mipmap prevents flicker at a distance.

    Args:
        pixels: sRGB, uint8 (height, width, 3), the first row at the top.
    Raises: OptionError for another type or shape.

    Attributes:
        texels: uint8 (k, 3), the pixels of all levels, the largest level first.
        levels: int32 (l, 4), mip levels, see `LEVEL`.
    """

    def __init__(self, pixels: ArrayLike) -> None:
        picture = to_array(pixels, "pixels")
        if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
            raise OptionError(
                f"pixels must be uint8 of shape (height, width, 3), got {picture.dtype} {picture.shape}"
            )
        if not 1 <= min(picture.shape[:2]) <= max(picture.shape[:2]) <= LARGEST:
            raise OptionError(f"a texture has 1 to {LARGEST} pixels along each edge, got {picture.shape[:2]}")
        pyramid = [picture]
        while max(pyramid[-1].shape[:2]) > 1:
            pyramid.append(_halved(pyramid[-1]))
        starts = np.cumsum([0, *(each.shape[0] * each.shape[1] for each in pyramid)])[:-1]
        self.texels = np.concatenate([each.reshape(-1, 3) for each in pyramid])
        self.levels = np.array(
            [
                (start, each.shape[1], each.shape[0], len(pyramid) - 1 - k)
                for k, (start, each) in enumerate(zip(starts, pyramid, strict=True))
            ],
            dtype=np.int32,
        )


def _halved(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Halve an image by averaging two by two pixels in linear light.

    An odd last row or column counts twice.
    """
    height, width = picture.shape[:2]
    padded = np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    light = to_linear(padded.astype(np.float32) / 255.0)
    mean = (light[::2, ::2] + light[1::2, ::2] + light[::2, 1::2] + light[1::2, 1::2]) / 4.0
    return np.round(255.0 * to_srgb(mean)).astype(np.uint8)


@dataclass(frozen=True)
class SceneTextures:
    """Textures of all surfaces, concatenated.

    Attributes:
        uv: float32 (n, 2), texture coordinates of the vertices, from the lower left.
        first_level: int32 (m,), index in `levels` of the largest mip level of each triangle's texture, or -1.
        texels, levels: see `Texture`.
    """

    uv: NDArray[np.float32]
    first_level: NDArray[np.int32]
    texels: NDArray[np.uint8]
    levels: NDArray[np.int32]

    @classmethod
    def of(
        cls,
        textures: Sequence[Texture | None],
        uvs: Sequence[NDArray[np.float32] | None],
        vertex_counts: Sequence[int],
        triangle_counts: Sequence[int],
    ) -> SceneTextures:
        """Collect the textures of surfaces. A texture used by several surfaces is stored once."""
        uv = [
            np.zeros((n, 2), dtype=np.float32) if own is None else own
            for own, n in zip(uvs, vertex_counts, strict=True)
        ]
        held = list({id(each): each for each in textures if each is not None}.values())
        if not held:
            nothing = np.zeros((1, 3), dtype=np.uint8), np.zeros((1, LEVEL), dtype=np.int32)
            return cls(np.concatenate(uv), np.full(sum(triangle_counts), -1, dtype=np.int32), *nothing)
        begins = np.cumsum([0, *(len(each.levels) for each in held)])[:-1]
        starts = np.cumsum([0, *(len(each.texels) for each in held)])[:-1]
        first = {id(each): int(begin) for each, begin in zip(held, begins, strict=True)}
        levels = [each.levels + np.array([start, 0, 0, 0]) for each, start in zip(held, starts, strict=True)]
        return cls(
            np.concatenate(uv),
            np.repeat([first.get(id(each), -1) for each in textures], triangle_counts).astype(np.int32),
            held[0].texels if len(held) == 1 else np.concatenate([each.texels for each in held]),
            np.concatenate(levels).astype(np.int32),
        )
