"""Materials of clips, in the form in which trimesh writes them to glTF."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft.bake.clip import Clip

PLAIN = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
"""Default material. glTF treats a material without these values as metal."""

COLORS = ((232, 107, 82), (41, 148, 158), (242, 178, 71), (102, 115, 199), (128, 178, 97), (204, 107, 153))
"""Default colours of bodies, sRGB from 0 to 255. Films use the same colours."""

UNSET = (102, 102, 102)
"""Grey that trimesh assigns to a material without a colour, sRGB from 0 to 255."""


def visual_of(clip: Clip, number: int) -> Any:
    """Make a trimesh `TextureVisuals` with a glTF material: the artist's material or a default material.

    Args:
        number: index of the clip. It selects the default colour.
    """
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    kind = getattr(clip.visual, "kind", None)
    if kind == "texture":
        kept = clip.visual.copy()
        kept.material = _as_pbr(kept.material)
        return kept
    if kind in ("vertex", "face"):
        plain = TextureVisuals(material=PBRMaterial(**PLAIN))
        plain.vertex_attributes["color"] = np.asarray(clip.visual.vertex_colors)
        return plain
    color = [*COLORS[number % len(COLORS)], 255]
    return TextureVisuals(material=PBRMaterial(name="plain", baseColorFactor=color, **PLAIN))


def _as_pbr(material: Any) -> Any:
    """Convert a material of an .obj file to glTF.

    Set the values whose glTF defaults differ. Remove the grey that trimesh assigns to materials without a
    colour, because this grey would darken the texture.
    """
    if not hasattr(material, "to_pbr"):
        return material
    made = material.to_pbr()
    made.metallicFactor = 0.0
    if getattr(material, "name", None):
        made.name = material.name
    if made.baseColorTexture is not None and tuple(np.asarray(material.diffuse)[:3]) == UNSET:
        made.baseColorFactor = None
    return made
