"""Equilibrium of a body between plates: vertices on the plates are prescribed, other vertices move freely.

Newton's method in float64 finds the state in which a damped body would come to rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.sparse_gradient import Floats, SparseGradient
from taichi_soft.meshing import TetMesh

Forces = Callable[[Floats], Floats]
"""Function that maps positions (n, 3) [m] to forces (n, 3) [N]."""

SMALLEST = 1e-9
"""Largest force that may remain on a free coordinate in equilibrium, as a fraction of the largest force."""
DIFFERENCE = 1e-6
"""Step of the finite differences [mean edge length]."""


class Plates:
    """A body about the origin whose lowest and highest vertices are on plates perpendicular to z.

    Args:
        mesh: the body at rest, with the same cross-section at all heights.
        slide: True if vertices on the plates can slide along them; False fixes them to the plates.
    """

    def __init__(self, mesh: TetMesh, *, slide: bool = False) -> None:
        self.mesh = mesh
        z = mesh.vertices[:, 2]
        self.height = float(np.ptp(z))
        self.top: NDArray[np.bool_] = z > z.max() - 1e-9 * self.height
        bottom = z < z.min() + 1e-9 * self.height
        driven = np.repeat((self.top | bottom)[:, None], 3, axis=1)
        if slide:
            driven[:, :2] = False
            axis = np.hypot(*mesh.vertices[:, :2].T) + 1e9 * ~bottom
            driven[axis.argmin(), :2] = True  # fix rigid motions
            driven[np.where(bottom, mesh.vertices[:, 0], -np.inf).argmax(), 1] = True
        self.free: NDArray[np.int64] = np.flatnonzero(~driven)
        """Indices of free coordinates, 3 * vertex + axis."""
        self._gradient = SparseGradient(_neighbours(mesh), DIFFERENCE * float(mesh.edge_lengths.mean()))

    @property
    def area(self) -> float:
        """Area of the cross-section [m^2]."""
        return self.mesh.volume / self.height

    def pull(self, forces: Floats) -> Floats:
        """Return the force that moves the top plate (3,) [N], from the internal forces (n, 3)."""
        return np.asarray(-forces[self.top].sum(axis=0))

    def path(self, forces: Forces, direction: Sequence[float], shares: Sequence[float]) -> list[Floats]:
        """Find the equilibria while the top moves in `direction` and the bottom is fixed.

        Args:
            direction: displacement of the top per unit of `shares` [height of the body].
            shares: increasing positive displacements of the top [height of the body]. Their spacing must be
                small enough to follow the branch of equilibria that starts at rest.
        Returns: positions (n, 3) [m] for each share, up to the first share without an equilibrium.
        """
        z = self.mesh.vertices[:, 2:]
        x = self.mesh.vertices.copy()
        rate, reached, states = (z - z.min()) * np.asarray(direction), 0.0, []
        for share in shares:
            rested = self.rest(forces, x + (share - reached) * rate)
            if rested is None:
                break
            rate = (rested - x) / (share - reached)
            x, reached = rested, share
            states.append(x)
        return states

    def rest(self, forces: Forces, start: Floats) -> Floats | None:
        """Return the equilibrium positions (n, 3) [m]; None if Newton's method fails.

        Args:
            start: positions from which Newton's method starts, (n, 3) [m].
        """
        from scipy.sparse.linalg import splu

        x, f = start, forces(start)
        left, inverse, is_new = np.abs(f.ravel()[self.free]).max(), None, False
        for _ in range(30):
            if left <= SMALLEST * np.abs(f).max():
                return x
            if inverse is None:
                inverse, is_new = splu(-self.gradient(forces, x)), True
            way = np.zeros(x.size)
            way[self.free] = inverse.solve(f.ravel()[self.free])
            for halvings in range(8):
                trial = x + way.reshape(-1, 3) / 2**halvings
                trial_f = forces(trial)
                trial_left = np.abs(trial_f.ravel()[self.free]).max()
                if trial_left < left or not is_new:
                    break
            else:
                return None
            if trial_left > 0.2 * left:
                inverse = None
            if trial_left < left:
                x, f, left = trial, trial_f, trial_left
            is_new = False
        return None

    def gradient(self, forces: Forces, x: Floats) -> Any:
        """Return df/dx of the free coordinates by central differences, a sparse matrix [N/m]."""
        return self._gradient.at(forces, x)[self.free][:, self.free].tocsc()


def _neighbours(mesh: TetMesh) -> Any:
    """Return a sparse, symmetric (n, n) matrix: 1 for equal vertices and for vertices that share an edge."""
    from scipy.sparse import csr_matrix

    every = np.arange(len(mesh.vertices))
    near = np.concatenate([mesh.edges, mesh.edges[:, ::-1], np.column_stack([every, every])])
    return csr_matrix((np.ones(len(near)), near.T), shape=(len(every), len(every)))
