"""The reference drop in NumPy, with float64, a textbook law, and much shorter steps than in any engine.

No engine uses the law psi = mu/2 (I - 3 - 2 ln J) + lambda/2 (ln J)^2 (Simo and Pister 1984). The floor is a
stiff spring under each vertex, so contact dissipates no energy. Without the springs, each impact of a vertex
would dissipate energy. This energy would depend on the mesh, because the surface of a real body has no mass.
With half the step and four times the stiffness of the floor, squash and bounce change by at most 0.6 %.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lab.peers.drop import GRAVITY, Drop
from lab.peers.trajectory import RATE, Progress, Simulation, Trajectory, record

Floats = NDArray[np.float64]

FLOOR = 1.6e7
"""Stiffness of the floor divided by the mass of a vertex [1/s^2]. With this value, vertices sink into the
floor by a few millimetres."""

FRACTION = 0.05
"""Length of a step, as a fraction of the time in which sound crosses the smallest altitude of all
tetrahedra."""


class Reference:
    """A body whose motion is integrated by Verlet's method.

    Tensors of tetrahedra are (3, 3, m): rows, columns, tetrahedra.
    """

    def __init__(self, drop: Drop, steps: int) -> None:
        """Create the body at the start of the drop. `advance` makes `steps` steps in 1 / RATE s."""
        self.drop, self.steps, self.h = drop, steps, 1.0 / (RATE * steps)
        self.masses, self.volumes = drop.masses, drop.volumes
        self.corners = drop.mesh.tets.T  # (4, m)
        self.rest_inverse = _inverse(_edges(drop.mesh.vertices, self.corners))
        self.positions = drop.start
        self.velocities = np.zeros_like(self.positions)
        self._accelerations = self.accelerations()

    def advance(self) -> None:
        """Advance by 1 / RATE s."""
        for _ in range(self.steps):
            self.velocities += self.h / 2 * self._accelerations
            self.positions = self.positions + self.h * self.velocities
            self._accelerations = self.accelerations()
            self.velocities += self.h / 2 * self._accelerations

    def energy(self) -> float:
        """Return the kinetic energy plus the potential energy of height, deformation and contact [J]."""
        (lam, mu), F = self.drop.lame, self._deformations()
        log = np.log(_cofactor(F)[1])
        shape = mu / 2 * ((F**2).sum(axis=(0, 1)) - 3.0 - 2.0 * log) + lam / 2 * log**2
        speeds, heights = (self.velocities**2).sum(axis=1), self.positions[:, 2]
        single = speeds / 2 + GRAVITY * heights + FLOOR / 2 * np.minimum(heights, 0.0) ** 2
        return float(self.volumes @ shape + self.masses @ single)

    def accelerations(self) -> Floats:
        """Return the accelerations of the vertices, (n, 3) [m/s^2]."""
        (lam, mu), F = self.drop.lame, self._deformations()
        across, J = _cofactor(F)
        P = mu * F + (lam * np.log(J) - mu) / J * across
        ends = -self.volumes * np.einsum("acm,bcm->abm", P, self.rest_inverse)  # forces on vertices 1 to 3
        forces = np.concatenate([-ends.sum(axis=1, keepdims=True), ends], axis=1)  # (3, 4, m)
        vertex, count = self.corners.ravel(), len(self.masses)
        total = np.stack([np.bincount(vertex, rows.ravel(), count) for rows in forces], axis=1)
        accelerations: Floats = total / self.masses[:, None]
        accelerations[:, 2] -= GRAVITY + FLOOR * np.minimum(self.positions[:, 2], 0.0)
        return accelerations

    def _deformations(self) -> Floats:
        F: Floats = np.einsum("abm,bcm->acm", _edges(self.positions, self.corners), self.rest_inverse)
        return F


def simulate_reference(drop: Drop, on_frame: Progress | None = None) -> Trajectory:
    """Simulate the drop as the reference for the engines."""

    def make(steps: int) -> Simulation:
        body = Reference(drop, steps)
        return Simulation(body.advance, lambda: body.positions, body.h)

    lam, mu = drop.lame
    crossing = FRACTION * _least_altitude(drop) / np.sqrt((lam + 2.0 * mu) / drop.density)
    return record(drop, make, int(np.ceil(1.0 / (RATE * crossing))), on_frame)


def _edges(positions: Floats, corners: NDArray[np.int32]) -> Floats:
    """Return the edges from the first vertex of each tetrahedron to the others, as columns, (3, 3, m) [m]."""
    places = positions.T[:, corners]
    edges: Floats = places[:, 1:] - places[:, :1]
    return edges


def _cofactor(F: Floats) -> tuple[Floats, Floats]:
    """Return the cofactor of each tensor, (3, 3, m), and its determinant, (m,)."""
    cofactor = np.empty_like(F)
    for row, column in np.ndindex(3, 3):
        i, j, k, l = (row + 1) % 3, (row + 2) % 3, (column + 1) % 3, (column + 2) % 3  # noqa: E741
        cofactor[row, column] = F[i, k] * F[j, l] - F[i, l] * F[j, k]
    return cofactor, (F[0] * cofactor[0]).sum(axis=0)


def _inverse(F: Floats) -> Floats:
    cofactor, J = _cofactor(F)
    inverse: Floats = cofactor.transpose(1, 0, 2) / J
    return inverse


def _least_altitude(drop: Drop) -> float:
    """Return the smallest altitude of all tetrahedra [m].

    An altitude is the inverse of the length of a barycentric coordinate's gradient.
    """
    inverse = _inverse(_edges(drop.mesh.vertices, drop.mesh.tets.T))
    gradients = np.concatenate([-inverse.sum(axis=0, keepdims=True), inverse])
    return 1.0 / float(np.linalg.norm(gradients, axis=1).max())
