"""The drop in NumPy: float64, a textbook's law, a tenth of the longest stable step.

psi = mu/2 (I - 3 - 2 ln J) + lambda/2 (ln J)^2 (Simo and Pister 1984) is the law of none of the engines. Each
vertex leaves the floor as fast as it met it, so contact takes no energy: that of a body has no mass, and what
a vertex would lose depends on the mesh alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft.lab.peers.course import RATE, Course, Progress, Simulation, record
from taichi_soft.lab.peers.drop import GRAVITY, Drop

Floats = NDArray[np.float64]

FRACTION = 0.1
"""Of the time that sound takes through the lowest tetrahedron."""


class Reference:
    """A body by Verlet's method."""

    def __init__(self, drop: Drop, steps: int) -> None:
        """`steps` are made in 1 / RATE s."""
        self.drop, self.steps, self.h = drop, steps, 1.0 / (RATE * steps)
        self.masses, self.volumes = drop.masses, drop.volumes
        self.tets = drop.mesh.tets
        self.rest_inverse = np.linalg.inv(_edges(drop.mesh.vertices, self.tets))
        self.positions = drop.start
        self.velocities = np.zeros_like(self.positions)
        self._accelerations = self._accelerate()

    def advance(self) -> None:
        """By 1 / RATE s."""
        for _ in range(self.steps):
            self.velocities += self.h / 2 * self._accelerations
            self.positions = self.positions + self.h * self.velocities
            below = self.positions[:, 2] < 0.0
            self.positions[below, 2] *= -1.0
            self.velocities[below, 2] = np.abs(self.velocities[below, 2])
            self._accelerations = self._accelerate()
            self.velocities += self.h / 2 * self._accelerations

    def energy(self) -> float:
        """Of motion, of height above the floor and of shape [J]."""
        (lam, mu), F = self.drop.lame, self._deformations()
        log = np.log(np.linalg.det(F))
        shape = mu / 2 * (np.einsum("mab,mab->m", F, F) - 3.0 - 2.0 * log) + lam / 2 * log**2
        speeds = (self.velocities**2).sum(axis=1)
        return float(self.volumes @ shape + self.masses @ (speeds / 2 + GRAVITY * self.positions[:, 2]))

    def _deformations(self) -> Floats:
        F: Floats = _edges(self.positions, self.tets) @ self.rest_inverse
        return F

    def _accelerate(self) -> Floats:
        """(n, 3) [m/s^2]."""
        (lam, mu), F = self.drop.lame, self._deformations()
        across = np.linalg.inv(F).transpose(0, 2, 1)
        P = mu * (F - across) + (lam * np.log(np.linalg.det(F)))[:, None, None] * across
        ends = -self.volumes[:, None, None] * (self.rest_inverse @ P.transpose(0, 2, 1))  # of vertices 1 to 3
        forces = np.concatenate([-ends.sum(axis=1, keepdims=True), ends], axis=1).reshape(-1, 3)
        corner, count = self.tets.ravel(), len(self.masses)
        total = np.stack([np.bincount(corner, forces[:, axis], count) for axis in range(3)], axis=1)
        accelerations: Floats = total / self.masses[:, None] - (0.0, 0.0, GRAVITY)
        return accelerations


def simulate_reference(drop: Drop, on_frame: Progress | None = None) -> Course:
    """The course that engines are measured by."""

    def make(steps: int) -> Simulation:
        body = Reference(drop, steps)
        return Simulation(body.advance, lambda: body.positions, body.h)

    lam, mu = drop.lame
    crossing = FRACTION * _least_altitude(drop) / np.sqrt((lam + 2.0 * mu) / drop.density)
    return record(drop, make, int(np.ceil(1.0 / (RATE * crossing))), on_frame)


def _edges(positions: Floats, tets: NDArray[np.int32]) -> Floats:
    """From the first vertex to the others, as columns, (m, 3, 3)."""
    corners = positions[tets]
    edges: Floats = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    return edges


def _least_altitude(drop: Drop) -> float:
    """Of all tetrahedra [m]: an altitude is the inverse of the gradient of a vertex's weight."""
    inverse = np.linalg.inv(_edges(drop.mesh.vertices, drop.mesh.tets))
    gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    return 1.0 / float(np.linalg.norm(gradients, axis=2).max())
