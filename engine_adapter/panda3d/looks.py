"""Convert texture and colour of an artist's mesh from trimesh's `visual` to Panda3D."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray
from panda3d import core

_UNSET = np.full(3, 102 / 255)
"""Grey that trimesh assigns to a material without a colour."""

_textures: dict[int, tuple[weakref.ref[Any], Any]] = {}  # textures, by id of the material


def texture_places(visual: Any, count: int) -> NDArray[np.float32] | None:
    """Return the texture coordinates of `count` vertices, float32 (count, 2) from 0 to 1; None without a
    texture.

    In trimesh and in Panda3D, v = 0 is the lowest row of the image.
    """
    if getattr(visual, "kind", None) != "texture" or _picture(visual.material) is None:
        return None
    if visual.uv is None or len(visual.uv) != count:
        return None
    return np.ascontiguousarray(visual.uv, dtype=np.float32)


def vertex_colors(visual: Any, count: int) -> NDArray[np.float32] | None:
    """Return the colours of `count` vertices, float32 (count, 4) from 0 to 1; None if the mesh has none."""
    if getattr(visual, "kind", None) not in ("vertex", "face") or len(visual.vertex_colors) != count:
        return None
    return np.asarray(np.asarray(visual.vertex_colors) / 255.0, dtype=np.float32)


def render_state(visual: Any, is_textured: bool) -> Any:
    """Make a Panda3D RenderState with the texture and colour of a material. The state is empty if the
    material has no texture and no colour.

    To override the colour, set another colour with a priority: `node.set_color(red, 1)`.
    """
    state = core.RenderState.make_empty()
    if getattr(visual, "kind", None) != "texture":
        return state
    factor = getattr(visual.material, "baseColorFactor", None)
    if is_textured:
        state = state.set_attrib(core.TextureAttrib.make(_texture(visual.material)))
        state = state.set_attrib(core.ColorAttrib.make_flat(core.LColor(1, 1, 1, 1)))
    if factor is not None:
        scale = 255.0 if np.asarray(factor).dtype.kind in "iu" else 1.0
        color = np.ones(4)
        color[: len(factor)] = np.asarray(factor, dtype=np.float64) / scale
        if is_textured or not np.allclose(color[:3], _UNSET):
            state = state.set_attrib(core.ColorAttrib.make_flat(core.LColor(*color)))
    return state


def _picture(material: Any) -> Any:
    """Return the image of a material (Pillow); None if the material has no image."""
    found = getattr(material, "baseColorTexture", None)
    return getattr(material, "image", None) if found is None else found


def _texture(material: Any) -> Any:
    """Return the core.Texture of a material. The texture is cached while the material exists."""
    kept = _textures.get(id(material))
    if kept is not None and kept[0]() is material:
        return kept[1]
    pixels = np.asarray(_picture(material).convert("RGBA"), dtype=np.uint8)
    texture = core.Texture("skin")
    texture.setup_2d_texture(
        pixels.shape[1], pixels.shape[0], core.Texture.T_unsigned_byte, core.Texture.F_rgba
    )
    texture.set_ram_image_as(pixels[::-1].tobytes(), "RGBA")  # Panda3D's first row is the lowest
    texture.set_minfilter(core.SamplerState.FT_linear_mipmap_linear)
    number = id(material)
    _textures[number] = weakref.ref(material, lambda _: _textures.pop(number, None)), texture
    return texture
