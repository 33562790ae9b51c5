"""How a surface looks, as trimesh keeps it: colours, or texture coordinates with a material."""

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
    """A material: its colour from 0 to 1, red, green, blue, opacity, and Pillow's image that covers it."""

    name: str
    color: tuple[float, float, float, float] | None = None
    picture: Any = None


def visual_of(
    *, uv: FloatArray | None = None, colors: FloatArray | None = None, look: Look | None = None
) -> Any:
    """trimesh's visual of vertices: of a picture, else of colours, else of a material; None without any.

    Args:
        uv: (n, 2), from the lower left corner; NaN where a vertex has none.
        colors: of vertices, (n, 3) or (n, 4), from 0 to 1, or up to 255.
    """
    from trimesh.visual import ColorVisuals, TextureVisuals  # half a second that a game need not wait for
    from trimesh.visual.material import PBRMaterial

    has_picture = look is not None and look.picture is not None
    if colors is not None and not has_picture:
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
    # Without one of its own trimesh would make a material with Pillow, which may be missing.
    material = PBRMaterial(
        name=look.name or None,
        baseColorFactor=None if has_picture else look.color,
        baseColorTexture=look.picture,
        metallicFactor=0.0,
        roughnessFactor=0.6,
    )
    return TextureVisuals(uv=uv, material=material)


def read_picture(name: str, content: bytes) -> Any:
    """Pillow's image.

    Args:
        name: of its file, for errors.
    Raises: MeshError where it cannot be read, or Pillow is not installed.
    """
    if missing_packages("film", "PIL"):
        raise MeshError(
            f"the texture {name} is not read: it takes pillow, not installed here: run pip install "
            "'taichi-soft[film]'"
        )
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(content))
            image.load()
    except Exception as error:  # each format's reader raises something else
        raise MeshError(f"the texture {name} is not read: {type(error).__name__}: {error}") from None
    return image


def find_beside(path: Path, name: str, folder: Path | None = None) -> Path | None:
    """The file that another one names, or None.

    It is looked for by its path from `folder` and from the folder of the file, then by its name in that
    folder, whatever its case; never outside of the folder above, as visitors of a server send such files.
    """
    parts = [part for part in name.strip().strip('"').replace("\\", "/").split("/") if part not in ("", ".")]
    if not parts:
        return None
    allowed = path.resolve().parent.parent
    alike = (each for each in sorted(path.parent.iterdir()) if each.name.lower() == parts[-1].lower())
    folders = (path.parent if folder is None else folder, path.parent)
    for candidate in (*(each.joinpath(*parts) for each in folders), *alike):
        try:
            found = candidate.resolve()
            if found.is_file() and found.is_relative_to(allowed):
                return found
        except (OSError, ValueError):  # such as for a name too long to exist
            continue
    return None
