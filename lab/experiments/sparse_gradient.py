"""Gradients of forces by central differences, for all laws, even those without an analytic gradient.

Two vertices are moved together if no force depends on both of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class SparseGradient:
    """Computes gradients of forces.

    Args:
        reads: sparse, symmetric matrix (n, n). An entry is non-zero if the force on one vertex depends on the
            position of the other vertex.
        step: step of the differences [m].
    """

    def __init__(self, reads: Any, step: float) -> None:
        self._touched, self._mover = reads.nonzero()
        self._colours = _colours(reads)
        self._step = step

    def at(self, forces: Callable[[Floats], Floats], positions: Floats) -> Any:
        """Return df/dx of forces (n, 3) [N] at positions (n, 3) [m], a sparse matrix (3n, 3n) [N/m]."""
        from scipy.sparse import csr_matrix

        blocks = np.empty((len(self._touched), 3, 3))  # axis of the force, axis of the displacement
        for colour in range(self._colours.max() + 1):
            is_moved = self._colours == colour
            ours = is_moved[self._mover]
            for axis in range(3):
                way = np.zeros_like(positions)
                way[is_moved, axis] = self._step
                change = forces(positions + way) - forces(positions - way)
                blocks[ours, :, axis] = change[self._touched[ours]] / (2 * self._step)
        three = np.arange(3)
        rows = np.broadcast_to(3 * self._touched[:, None, None] + three[:, None], blocks.shape)
        columns = np.broadcast_to(3 * self._mover[:, None, None] + three, blocks.shape)
        size = positions.size
        return csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))


def _colours(reads: Any) -> NDArray[np.int64]:
    """Assign colours to vertices so that no force depends on two vertices of the same colour."""
    near = (reads @ reads).tocsr()
    colours = np.full(near.shape[0], -1)
    for vertex in range(len(colours)):
        taken = set(colours[near.indices[near.indptr[vertex] : near.indptr[vertex + 1]]].tolist())
        colours[vertex] = next(number for number in range(len(taken) + 1) if number not in taken)
    return colours
