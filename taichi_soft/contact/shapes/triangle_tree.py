"""Boxes round triangles, round pairs of them, pairs of pairs and so on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing import spatial_order

NOWHERE = 1e15
"""Of the boxes of leaves without triangle: nothing is near them, and its square fits float32."""


def triangle_tree(corners: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The triangles (f, 3, 3) in the order of the leaves, and the boxes.

    Boxes are lower and upper corners (2 n, 6), n a power of two: the root is 1, the children of i are 2 i
    and 2 i + 1, the leaves n to 2 n - 1 hold one triangle each or none.
    """
    ordered = corners[spatial_order(corners.mean(axis=1))]
    count = 1 << (len(ordered) - 1).bit_length()
    low = np.full((count, 3), NOWHERE, dtype=np.float32)
    high = -low  # empty, and the other way round, so that it adds nothing to its parent
    low[: len(ordered)], high[: len(ordered)] = ordered.min(axis=1), ordered.max(axis=1)
    levels = [np.hstack([low, high])]
    while count > 1:
        count //= 2
        low, high = low.reshape(count, 2, 3).min(axis=1), high.reshape(count, 2, 3).max(axis=1)
        levels.append(np.hstack([low, high]))
    unused = np.zeros((1, 6), dtype=np.float32)
    return ordered, np.concatenate([unused, *levels[::-1]])
