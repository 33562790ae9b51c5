"""Find connected components of elements and of voxels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def components(count: int, pairs: Ints) -> Ints:
    """Return the number of the component that contains each of `count` elements, (count,).

    Components are numbered from 0, in the order of their first elements.
    Args: pairs: connected elements, (k, 2).
    """
    root = np.arange(count)
    while True:
        a, b = root[pairs[:, 0]], root[pairs[:, 1]]
        differs = a != b
        if not differs.any():
            return np.unique(root, return_inverse=True)[1].reshape(-1)
        pairs = pairs[differs]
        np.minimum.at(root, np.maximum(a, b)[differs], np.minimum(a, b)[differs])
        while (root != root[root]).any():
            root = root[root]


def parts_of(fill: NDArray[np.float64]) -> Ints:
    """Return the component number of each voxel, -1 for empty voxels.

    Voxels that touch at a face, an edge or a corner are connected.
    """
    is_full = fill > 0.0
    # Runs of voxels along the last axis are connected, and there are far fewer runs than voxels.
    begins = is_full.copy()
    begins[..., 1:] &= ~is_full[..., :-1]
    row = np.cumsum(begins.ravel()).reshape(fill.shape) - 1
    pairs = []
    steps = np.argwhere(np.ones((3, 3, 3))) - 1
    for step in steps[15:]:  # half of the neighbours suffice, by symmetry; steps[14] is in the same run
        here = tuple(slice(max(0, -s), fill.shape[k] - max(0, s)) for k, s in enumerate(step))
        there = tuple(slice(max(0, s), fill.shape[k] - max(0, -s)) for k, s in enumerate(step))
        both = is_full[here] & is_full[there]
        found = np.stack([row[here][both], row[there][both]], axis=1)
        is_new = (np.diff(found, axis=0, prepend=-1) != 0).any(axis=1)
        pairs.append(found[is_new])
    part_of_row = components(int(begins.sum()), np.concatenate(pairs))
    return np.where(is_full, part_of_row[np.maximum(row, 0)], -1)
