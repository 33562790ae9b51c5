"""Flat arrays of all surfaces of a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import OptionError
from taichi_soft.render.drawn_surface import Surface
from taichi_soft.render.geometry_kernels import compute_normals
from taichi_soft.render.texture import SceneTextures


@dataclass(frozen=True)
class SceneArrays:
    """Vertices and triangles of all surfaces, concatenated.

    Attributes:
        positions, normals, colors: positions [m], unit normals and colours in linear light of the vertices,
            each float32 (n, 3).
        triangles: vertex indices, int32 (m, 3), counterclockwise seen from outside.
        looks: look codes of the triangles, int32 (m,), see `look`.
        textures: textures of all surfaces.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    colors: NDArray[np.float32]
    triangles: NDArray[np.int32]
    looks: NDArray[np.int32]
    textures: SceneTextures

    @property
    def is_empty(self) -> bool:
        """True if the scene has no visible triangle."""
        return len(self.triangles) == 1

    @classmethod
    def of(cls, surfaces: Sequence[Surface]) -> SceneArrays:
        """Concatenate the arrays of surfaces. An empty list gives one invisible, degenerate triangle.

        Raises: OptionError for anything that is not a `Surface`.
        """
        if not isinstance(surfaces, (list, tuple)):
            raise OptionError(f"render takes a list of Surface objects, got {type(surfaces).__name__}")
        for surface in surfaces:
            if not isinstance(surface, Surface):
                raise OptionError(f"render takes Surface objects, got {type(surface).__name__}")
        if not surfaces:
            nothing = np.zeros((1, 3), dtype=np.float32)
            textures = SceneTextures.of([None], [None], [1], [1])
            none = np.zeros((1, 3), dtype=np.int32)
            return cls(nothing, nothing, nothing, none, none[:, 0].copy(), textures)
        positions = np.concatenate([surface.positions for surface in surfaces])
        counts = [len(surface.positions) for surface in surfaces]
        offsets = np.cumsum([0, *counts[:-1]], dtype=np.int32)
        triangles = np.concatenate(
            [s.triangles + offset for s, offset in zip(surfaces, offsets, strict=True)], dtype=np.int32
        )
        normals = np.empty_like(positions)
        compute_normals(positions, triangles, normals)
        for surface, offset in zip(surfaces, offsets, strict=True):
            if surface.normals is not None:
                normals[offset : offset + len(surface.positions)] = surface.normals
        colors = np.concatenate([surface.color for surface in surfaces])
        textures = SceneTextures.of(
            [surface.texture for surface in surfaces],
            [surface.uv for surface in surfaces],
            counts,
            [len(surface.triangles) for surface in surfaces],
        )
        looks = np.concatenate([surface.looks for surface in surfaces])
        return cls(positions, normals, colors, triangles, looks, textures)
