"""A binary tree of bounding boxes over triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.meshing import spatial_order

FAR_AWAY = 1e15
"""Coordinate of empty leaves, far from all triangles. The square of this number fits into float32."""


def triangle_tree(corners: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the triangles in the order of the leaves, (f, 3, 3), and the boxes of the tree, (2 n, 6).

    Each box has a lower and an upper corner. n is a power of two. Box 1 is the root, box i has the children
    2 i and 2 i + 1, and boxes n to 2 n - 1 are leaves, which contain one triangle or none.
    """
    ordered = corners[spatial_order(corners.mean(axis=1))]
    count = 1 << (len(ordered) - 1).bit_length()
    low = np.full((count, 3), FAR_AWAY, dtype=np.float32)
    high = -low  # empty boxes have low > high, so that they do not enlarge their parents
    low[: len(ordered)], high[: len(ordered)] = ordered.min(axis=1), ordered.max(axis=1)
    levels = [np.hstack([low, high])]
    while count > 1:
        count //= 2
        low, high = low.reshape(count, 2, 3).min(axis=1), high.reshape(count, 2, 3).max(axis=1)
        levels.append(np.hstack([low, high]))
    unused = np.zeros((1, 6), dtype=np.float32)
    return ordered, np.concatenate([unused, *levels[::-1]])
