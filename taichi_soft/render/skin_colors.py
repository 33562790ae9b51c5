"""Colours of an artist's mesh, one for each vertex: from its texture, its material or its own colours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats32 = NDArray[np.float32]

UNSAID = np.full(3, 102 / 255, dtype=np.float32)
"""The grey that trimesh gives a material without a colour."""


def vertex_colors(visual: Any, count: int, otherwise: ArrayLike) -> Floats32:
    """sRGB from 0 to 1, (count, 3).

    A texture is looked up where each vertex lies on it: what is finer than the triangles is lost.
    Args:
        visual: trimesh's, or None.
        count: of vertices.
        otherwise: colour (3,) where there is none.
    """
    rows = np.broadcast_to(np.asarray(otherwise, dtype=np.float32), (count, 3)).copy()
    kind = getattr(visual, "kind", None)
    if kind == "texture":
        material = visual.material
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        if image is not None and visual.uv is not None and len(visual.uv) == count:
            rows = _looked_up(np.asarray(image.convert("RGB"), dtype=np.float32) / 255.0, visual.uv)
        else:
            plain = getattr(material, "baseColorFactor", None)
            if plain is not None and not np.array_equal(_as_colors(plain)[:3], UNSAID):
                rows[:] = _as_colors(plain)[:3]
    elif kind in ("vertex", "face"):
        rows = _as_colors(visual.vertex_colors)[:, :3]
    return np.ascontiguousarray(rows, dtype=np.float32)


def _as_colors(values: Any) -> Floats32:
    """From 0 to 1, whether whole numbers up to 255 are given or reals up to 1."""
    array = np.asarray(values)
    scale = 255.0 if array.dtype.kind in "iu" else 1.0
    return np.asarray(np.clip(array.astype(np.float32) / scale, 0.0, 1.0), dtype=np.float32)


def _looked_up(image: Floats32, uv: Any) -> Floats32:
    """Pixels at texture coordinates (n, 2), which begin at the lower left and repeat, (n, 3)."""
    height, width = image.shape[:2]
    u, v = (np.asarray(uv, dtype=np.float64) % 1.0).T
    column = np.minimum((u * width).astype(np.int64), width - 1)
    row = np.minimum(((1.0 - v) * height).astype(np.int64), height - 1)
    return np.asarray(image[row, column])
