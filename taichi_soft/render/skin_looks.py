"""Texture and vertex colours of an artist's mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats32 = NDArray[np.float32]

UNSET = np.full(3, 102 / 255, dtype=np.float32)
"""Grey that trimesh assigns to a material without a colour, sRGB from 0 to 1."""


def texture_picture(visual: Any, count: int) -> Any:
    """Return the texture of a mesh as a Pillow image, or None if the mesh has no texture.

    Args:
        visual: `visual` of a trimesh mesh, or None.
        count: number of vertices, each of which must have texture coordinates.
    """
    if getattr(visual, "kind", None) != "texture":
        return None
    material = visual.material
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    return image if visual.uv is not None and len(visual.uv) == count else None


def vertex_colors(visual: Any, count: int, otherwise: ArrayLike) -> Floats32:
    """Return the vertex colours of a mesh, sRGB from 0 to 1, (count, 3). They tint the texture.

    Args:
        visual: `visual` of a trimesh mesh, or None.
        count: number of vertices.
        otherwise: colour (3,) of a mesh without texture and colour.
    """
    rows = np.broadcast_to(np.asarray(otherwise, dtype=np.float32), (count, 3)).copy()
    kind = getattr(visual, "kind", None)
    if kind == "texture":
        factor = getattr(visual.material, "baseColorFactor", None)
        own = visual.vertex_attributes.get("color")
        if own is not None or texture_picture(visual, count) is not None:
            rows[:] = 1.0 if factor is None else _as_colors(factor)[:3]
            rows *= 1.0 if own is None else _as_colors(own)[:, :3]
        elif factor is not None and not np.array_equal(_as_colors(factor)[:3], UNSET):
            rows[:] = _as_colors(factor)[:3]
    elif kind in ("vertex", "face"):
        rows = _as_colors(visual.vertex_colors)[:, :3]
    return np.ascontiguousarray(rows, dtype=np.float32)


def _as_colors(values: Any) -> Floats32:
    """Scale integer colours to the range 0 to 1; floats already have this range."""
    array = np.asarray(values)
    scale = 255.0 if array.dtype.kind in "iu" else 1.0
    return np.asarray(np.clip(array.astype(np.float32) / scale, 0.0, 1.0), dtype=np.float32)
