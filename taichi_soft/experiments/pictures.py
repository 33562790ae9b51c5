"""Pictures of bodies, from their positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft import TetMesh
from taichi_soft.render import PALETTE, Camera, Renderer, Surface


def picture(
    bodies: Sequence[tuple[TetMesh, ArrayLike]], floor: bool, size: tuple[int, int] = (640, 400)
) -> NDArray[np.uint8]:
    """Bodies at (n, 3) positions [m], side by side as they are, from a little above; z is up.

    Args:
        floor: whether there is one, at height 0.
        size: width and height [pixels].
    """
    surfaces, rows = [], []
    for number, (mesh, positions) in enumerate(bodies):
        surface = Surface.of(mesh, color=PALETTE[number % len(PALETTE)])
        surface.positions = np.asarray(positions, dtype=np.float32)
        surfaces.append(surface)
        rows.append(np.asarray(positions, dtype=np.float64))
    lower, upper = np.min(np.concatenate(rows), axis=0), np.max(np.concatenate(rows), axis=0)
    if floor:
        lower[2] = min(0.0, lower[2])
    camera = Camera.framing(lower, upper, aspect=size[0] / size[1], azimuth=-90.0, elevation=10.0, margin=1.2)
    renderer = Renderer(*size, camera=camera, floor=0.0 if floor else None)
    return renderer.render(surfaces)
