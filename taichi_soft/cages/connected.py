"""Which of many things hang together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def components(count: int, pairs: Ints) -> Ints:
    """A number from 0 on for each of `count` things, alike where `pairs` (k, 2) lead from one to the other.

    Numbers follow the first thing of each component.
    """
    root = np.arange(count)
    while True:
        a, b = root[pairs[:, 0]], root[pairs[:, 1]]
        apart = a != b
        if not apart.any():
            return np.unique(root, return_inverse=True)[1].reshape(-1)
        pairs = pairs[apart]
        np.minimum.at(root, np.maximum(a, b)[apart], np.minimum(a, b)[apart])
        while (root != root[root]).any():
            root = root[root]


def parts_of(fill: NDArray[np.float64]) -> Ints:
    """The part that each voxel belongs to, -1 where it is empty: voxels that touch, if at a corner only."""
    is_full = fill > 0.0
    number = np.full(fill.shape, -1)
    number[is_full] = np.arange(int(is_full.sum()))
    pairs = []
    steps = np.argwhere(np.ones((3, 3, 3))) - 1
    for step in steps[14:]:  # half of the neighbours: the others look back
        here = tuple(slice(max(0, -s), fill.shape[k] - max(0, s)) for k, s in enumerate(step))
        there = tuple(slice(max(0, s), fill.shape[k] - max(0, -s)) for k, s in enumerate(step))
        both = is_full[here] & is_full[there]
        pairs.append(np.stack([number[here][both], number[there][both]], axis=1))
    parts = np.full(fill.shape, -1)
    parts[is_full] = components(int(is_full.sum()), np.concatenate(pairs))
    return parts
