"""What a clip's mesh looks like, as trimesh writes it to glTF."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_soft.bake.clip import Clip

PLAIN = {"metallicFactor": 0.0, "roughnessFactor": 0.6}
"""Of what has no material of its own. glTF takes what is left out for metal."""

COLORS = ((232, 107, 82), (41, 148, 158), (242, 178, 71), (102, 115, 199), (128, 178, 97), (204, 107, 153))
"""Of bodies without a colour, sRGB up to 255, as films have them."""

UNSAID = (102, 102, 102)
"""The grey that trimesh gives a material without a colour."""


def visual_of(clip: Clip, number: int) -> Any:
    """trimesh's TextureVisuals with a material of glTF: the artist's, or a plain one.

    Args:
        number: of the clip; one without any colour takes that of the palette.
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
    """The material of an .obj with the numbers that glTF would take otherwise where they are left out, and
    without the grey that trimesh gives to what says none, which would darken its texture."""
    if not hasattr(material, "to_pbr"):
        return material
    made = material.to_pbr()
    made.metallicFactor = 0.0
    if getattr(material, "name", None):
        made.name = material.name
    if made.baseColorTexture is not None and tuple(np.asarray(material.diffuse)[:3]) == UNSAID:
        made.baseColorFactor = None
    return made
