"""Bake formats, by file suffix."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from taichi_soft.bake.clip import Take
from taichi_soft.bake.gltf import Interpolation, write_glb
from taichi_soft.bake.point_cache import write_npz
from taichi_soft.bake.usd import write_usd
from taichi_soft.bake.vertex_texture import require_pixels, write_vat
from taichi_soft.core.errors import OptionError

LARGEST_GLB = 4 * 1024**3 - 1
"""Largest size of a .glb file [bytes]. The length field in the file has 32 bits."""


class Format(NamedTuple):
    """Functions that write a bake format and check its limits, and the packages that it needs."""

    write: Callable[[Take, Path, Interpolation], object]
    size: Callable[[int, int], int]  # function of (frames, vertices) that returns the size [bytes]
    needs: tuple[str, ...]  # extra and its required modules; empty if NumPy is sufficient
    require: Callable[[int, int], object]  # raises an error for (frames, vertices) that exceed the format


def _any(frames: int, vertices: int) -> None:
    pass


def _floats(frames: int, vertices: int) -> int:
    """Return the size of positions and normals [bytes]."""
    return 24 * frames * vertices


def _with_weights(frames: int, vertices: int) -> int:
    """Return the size of positions, normals and a (frames, frames) matrix of weights [bytes]."""
    return _floats(frames + 1, vertices) + 4 * frames**2


def _pixels(frames: int, vertices: int) -> int:
    return 9 * frames * vertices


def _below_4_gib(frames: int, vertices: int) -> None:
    if _with_weights(frames, vertices) > LARGEST_GLB:
        raise OptionError(
            f"{vertices:,} vertices in {frames:,} frames exceed the 4 GiB of a .glb: bake "
            "fewer --seconds or --fps, or a coarser mesh, or into .npz, .usdc or .vat"
        )


GLTF = ("bake", "pygltflib", "PIL")

FORMATS = {
    ".glb": Format(write_glb, _with_weights, GLTF, _below_4_gib),
    ".npz": Format(lambda take, path, _: write_npz(take, path), _floats, (), _any),
    ".vat": Format(lambda take, path, _: write_vat(take, path), _pixels, GLTF, require_pixels),
    ".usdc": Format(lambda take, path, _: write_usd(take, path), _floats, ("usd", "pxr"), _any),
}
