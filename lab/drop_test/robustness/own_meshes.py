"""The library's own shapes in four resolutions each, about 1 m wide."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from taichi_soft import TetMesh, beam, box, cylinder, sphere, torus, voxels

Maker = Callable[[], TetMesh]


def _frame(cells: int) -> TetMesh:
    """Make a mesh of bars along the twelve edges of a cube, each `cells` cells thick."""
    side = 4 * cells
    index = np.arange(side)
    is_outer = (index < cells) | (index >= side - cells)
    outer_axes = is_outer[:, None, None].astype(int) + is_outer[:, None] + is_outer
    return voxels(outer_axes >= 2, 1.0 / side)


OWN_MESHES: dict[str, Maker] = {
    **{f"box {n}": partial(box, (1.0, 0.8, 0.6), (n, n, n)) for n in (2, 4, 6, 9)},
    **{f"slab {n}": partial(box, (1.0, 1.0, 0.1 * n), (10, 10, n)) for n in (1, 2, 3, 4)},
    **{f"beam {n}": partial(beam, 1.0, 0.2, 0.2, n) for n in (1, 2, 3, 4)},
    **{f"sphere {n}": partial(sphere, 0.5, n) for n in (2, 4, 6, 7)},
    **{f"cylinder {n}": partial(cylinder, 0.4, 1.0, n, 3 * n) for n in (1, 2, 3, 4)},
    **{f"disc {n}": partial(cylinder, 0.5, 0.05 * n, 2 * n, n) for n in (1, 2, 3, 4)},
    **{f"torus {n}": partial(torus, 0.35, 0.15, n, 16 * n) for n in (1, 2, 3, 4)},
    **{f"ring {n}": partial(torus, 0.45, 0.05, n, 50 * n) for n in (1, 2, 3)},
    "ring 2 coarse": partial(torus, 0.45, 0.05, 2, 24),
    **{f"frame {n}": partial(_frame, n) for n in (1, 2, 3, 4)},
}
