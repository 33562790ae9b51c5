"""Write a vertex-animation texture: images from which a shader reads the vertices' positions in each frame.

Each pixel is one vertex in one frame. Vertex v of frame f is in column v % width and row
f * rows_per_frame + v // width, counted from the upper left. Positions have 16 bits per axis, from the lowest
to the highest position of the whole bake. One image has the upper eight bits and another image the lower
eight, because engines treat 16-bit images differently. All vertices of an absent body are at one point, so
that the body is invisible.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bake.axes import y_up
from taichi_soft.bake.clip import Clip, Take
from taichi_soft.bake.gltf import GlbFile
from taichi_soft.core.errors import OptionError

WIDEST, TALLEST = 4096, 16384
"""WIDEST: largest width of a texture [pixels]. TALLEST: largest height of a texture [pixels], because common
GPUs do not support more rows."""

LEVELS = 65535
"""Number of quantisation steps with 16 bits."""

METADATA = "metadata.json"
GODOT_3 = {
    "godot": "3 (GLES3)",
    "import": 'Compress/Mode "Lossless", Mipmaps, Filter,\n// Repeat, Srgb and Fix Alpha Border off',
    "data": "",
    "picture": " : hint_albedo",
    "colour": " : hint_color",
}
GODOT_4 = {
    "godot": "4",
    "import": 'Compress/Mode "Lossless", Mipmaps/Generate and\n// Process/Fix Alpha Border off',
    "data": " : filter_nearest, repeat_disable",
    "picture": " : source_color, hint_default_white",
    "colour": " : source_color",
}
SHADERS = {
    "godot.gdshader": ("godot.gdshader", GODOT_4),
    "godot3.shader": ("godot.gdshader", GODOT_3),
    "unity.hlsl": ("unity.hlsl", {}),
}
"""For each shader file, its template, and the words of the engine that replace the template's
placeholders."""

Floats = NDArray[np.float64]


def fits_texture(frames: int, vertices: int) -> bool:
    """True if a texture can hold these frames and vertices."""
    return -(-vertices // WIDEST) * frames <= TALLEST


def require_pixels(frames: int, vertices: int) -> None:
    """Raise an OptionError if a texture would have too many rows."""
    if not fits_texture(frames, vertices):
        each = -(-vertices // WIDEST)
        raise OptionError(
            f"{vertices:,} vertices in {frames:,} frames need a texture of {each * frames:,} rows, and GPUs "
            f"support {TALLEST:,}: bake at most {TALLEST // each:,} frames (fewer --seconds or --fps), or a "
            "coarser mesh"
        )


def write_vat(take: Take, folder: Path) -> None:
    """Write a take to a folder with images, mesh, metadata and shaders. Raises: OptionError, OSError."""
    require_pixels(take.frame_count, take.vertex_count)
    folder.mkdir()
    width = min(take.vertex_count, WIDEST)
    rows = -(-take.vertex_count // width)
    low, high = _bounds(take)
    positions = np.zeros((take.frame_count, rows * width, 3), dtype=np.uint16)
    normals = np.zeros((take.frame_count, rows * width, 3), dtype=np.uint8)
    extent = np.where(high > low, high - low, 1.0)
    for frame in range(take.frame_count):
        place, normal = _frame(take, frame)
        positions[frame, : take.vertex_count] = np.rint((place - low) / extent * LEVELS)
        normals[frame, : take.vertex_count] = np.rint((np.clip(normal, -1.0, 1.0) + 1.0) / 2.0 * 255.0)
    shape = take.frame_count * rows, width, 3
    _write_picture(folder / "position_high.png", (positions >> 8).astype(np.uint8).reshape(shape))
    _write_picture(folder / "position_low.png", (positions & 255).astype(np.uint8).reshape(shape))
    _write_picture(folder / "normal.png", normals.reshape(shape))
    _write_mesh(take, folder / "mesh.glb", width, rows)
    facts: dict[str, Any] = {
        "made_by": "taichi-soft bake",
        "lowest": low.tolist(),
        "highest": (low + extent).tolist(),
        "frame_count": take.frame_count,
        "fps": take.fps,
        "vertex_count": take.vertex_count,
        "width": width,
        "height": take.frame_count * rows,
        "rows_per_frame": rows,
        "axes": "metres, right-handed, y up, as in mesh.glb",
        "meshes": _mesh_facts(take),
    }
    (folder / METADATA).write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    for name, (template, words) in SHADERS.items():
        (folder / name).write_text(_shader(template, words, facts), encoding="utf-8")


def is_vat(folder: Path) -> bool:
    """True if `write_vat` made the folder."""
    return (folder / METADATA).is_file() and (folder / "position_high.png").is_file()


def _frame(take: Take, frame: int) -> tuple[Floats, Floats]:
    """Return positions and normals of all vertices in a frame, y up. An absent body is shrunk to a point."""
    places, normals = [], []
    for clip in take.clips:
        position, normal = clip.at(frame)
        places.append(position if clip.is_there(frame) else _gathered(clip, frame))
        normals.append(normal)
    return (
        y_up(np.concatenate(places).astype(np.float64)),
        y_up(np.concatenate(normals).astype(np.float64)),
    )


def _gathered(clip: Clip, frame: int) -> Floats:
    """Return positions (k, 3) that all equal the centre of a clip in a frame."""
    rows = clip.at(frame)[0].astype(np.float64)
    return np.repeat(rows.mean(axis=0, keepdims=True), len(rows), axis=0)


def _bounds(take: Take) -> tuple[Floats, Floats]:
    each = [y_up(rows) for clip in take.clips for rows in clip.positions]
    low, high = np.min([rows.min(0) for rows in each], 0), np.max([rows.max(0) for rows in each], 0)
    return low.astype(np.float64), high.astype(np.float64)


def _mesh_facts(take: Take) -> list[dict[str, Any]]:
    start, facts = 0, []
    for clip in take.clips:
        facts.append({"name": clip.name, "first_vertex": start, "vertex_count": clip.vertex_count})
        start += clip.vertex_count
    return facts


def _write_mesh(take: Take, path: Path, width: int, rows: int) -> None:
    """Write the first frame with a second set of texture coordinates: the pixel of each vertex."""
    file = GlbFile(take)
    start = 0
    for clip in take.clips:
        vertex = start + np.arange(clip.vertex_count)
        pixel = np.stack([(vertex % width + 0.5) / width, (vertex // width + 0.5) / rows], axis=1)
        attributes = file.mesh_of(clip).primitives[0].attributes
        if attributes.TEXCOORD_0 is None:  # a mesh with a second set must also have a first set
            attributes.TEXCOORD_0 = file.add(np.zeros((clip.vertex_count, 2)))
        attributes.TEXCOORD_1 = file.add(pixel)
        start += clip.vertex_count
    file.save(path)


def _write_picture(path: Path, pixels: NDArray[np.uint8]) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path, format="PNG")


def _shader(template: str, words: dict[str, str], facts: dict[str, Any]) -> str:
    text = (Path(__file__).parent / "shaders" / template).read_text(encoding="utf-8")
    numbers = {key: ", ".join(f"{value:.9g}" for value in facts[key]) for key in ("lowest", "highest")}
    numbers |= {key: str(facts[key]) for key in ("frame_count", "rows_per_frame")}
    numbers["fps"] = repr(float(facts["fps"]))
    for key, value in (words | numbers).items():
        text = text.replace(f"@{key}@", value)
    return text
