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
    # Voxels in a row along the last axis hang together: there are far fewer rows than voxels.
    begins = is_full.copy()
    begins[..., 1:] &= ~is_full[..., :-1]
    row = np.cumsum(begins.ravel()).reshape(fill.shape) - 1
    pairs = []
    steps = np.argwhere(np.ones((3, 3, 3))) - 1
    for step in steps[15:]:  # half of the neighbours: the others look back, and one is in the same row
        here = tuple(slice(max(0, -s), fill.shape[k] - max(0, s)) for k, s in enumerate(step))
        there = tuple(slice(max(0, s), fill.shape[k] - max(0, -s)) for k, s in enumerate(step))
        both = is_full[here] & is_full[there]
        found = np.stack([row[here][both], row[there][both]], axis=1)
        is_new = (np.diff(found, axis=0, prepend=-1) != 0).any(axis=1)
        pairs.append(found[is_new])
    part_of_row = components(int(begins.sum()), np.concatenate(pairs))
    return np.where(is_full, part_of_row[np.maximum(row, 0)], -1)
