"""Appearance of a surface as a trimesh visual: colours, or texture coordinates with a material."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taichi_soft.core.errors import MeshError
from taichi_soft.core.extras import missing_packages
from taichi_soft.meshing.arrays import FloatArray


@dataclass(frozen=True)
class Look:
    """Material of a file: red, green, blue and opacity from 0 to 1, and the texture as a Pillow image."""

    name: str
    color: tuple[float, float, float, float] | None = None
    image: Any = None


def visual_of(
    *, uv: FloatArray | None = None, colors: FloatArray | None = None, look: Look | None = None
) -> Any:
    """Return a trimesh visual from a texture, colours or a material, in this order of preference, or None.

    Args:
        uv: texture coordinates from the lower left corner, (n, 2); NaN for vertices without coordinates.
        colors: colours of vertices, (n, 3) or (n, 4), from 0 to 1 or from 0 to 255.
    """
    from trimesh.visual import ColorVisuals, TextureVisuals  # slow to import, and games do not need it
    from trimesh.visual.material import PBRMaterial

    has_image = look is not None and look.image is not None
    if colors is not None and not has_image:
        colors = np.nan_to_num(colors)
        scale = 255.0 if colors.max(initial=0.0) <= 1.0 else 1.0
        return ColorVisuals(vertex_colors=np.clip(np.round(scale * colors), 0, 255).astype(np.uint8))
    if uv is None or np.isnan(uv).all():
        if look is None:
            return None
        uv = None
    else:
        uv = np.nan_to_num(uv)
    look = look or Look("")
    # By default trimesh makes a material with Pillow, which can be missing.
    material = PBRMaterial(
        name=look.name or None,
        baseColorFactor=None if has_image else look.color,
        baseColorTexture=look.image,
        metallicFactor=0.0,
        roughnessFactor=0.6,
    )
    return TextureVisuals(uv=uv, material=material)


def read_image(name: str, content: bytes) -> Any:
    """Decode an image with Pillow.

    Args:
        name: name of the image's file, for error messages.
    Raises: MeshError if the image cannot be read or Pillow is not installed.
    """
    if missing_packages("film", "PIL"):
        raise MeshError(
            f"the texture {name} is not read: it needs pillow, which is not installed here: run pip install "
            "'taichi-soft[film]'"
        )
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(content))
            image.load()
    except Exception as error:  # Pillow's readers raise exceptions of many kinds
        raise MeshError(f"the texture {name} is not read: {type(error).__name__}: {error}") from None
    return image


def find_referenced_file(path: Path, name: str, folder: Path | None = None) -> Path | None:
    """Return the path of the file `name` to which the file `path` refers, or None if there is no such file.

    The search tries `name` relative to `folder`, then relative to the folder of `path`. Then it looks in the
    folder of `path` for a file with the same last part of the name, ignoring case. Files outside the parent
    of that folder are ignored, because visitors of a server can send such names.
    """
    parts = [part for part in name.strip().strip('"').replace("\\", "/").split("/") if part not in ("", ".")]
    if not parts:
        return None
    allowed = path.resolve().parent.parent
    same_name = (each for each in sorted(path.parent.iterdir()) if each.name.lower() == parts[-1].lower())
    folders = (path.parent if folder is None else folder, path.parent)
    for candidate in (*(each.joinpath(*parts) for each in folders), *same_name):
        try:
            found = candidate.resolve()
            if found.is_file() and found.is_relative_to(allowed):
                return found
        except (OSError, ValueError):  # for example for a name that is too long
            continue
    return None
