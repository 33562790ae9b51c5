"""The drop that every engine simulates: mesh, elastic material, and height."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taichi_soft import TetMesh, sphere

Floats = NDArray[np.float64]

GRAVITY = 9.81
"""Gravity [m/s^2]."""


@dataclass(frozen=True)
class Drop:
    """A body that falls onto a level floor at z = 0, without damping or friction.

    The default sphere of 1,280 tetrahedra is squashed by a sixth. Common material laws agree up to this
    strain, so differences between engines come from their solvers.
    """

    mesh: TetMesh = field(default_factory=lambda: sphere(0.5, 4))
    young: float = 1e6  # Young's modulus [Pa]
    poisson: float = 0.3
    density: float = 1000.0  # [kg/m^3]
    height: float = 0.8  # initial height of the lowest vertex above the floor [m]
    seconds: float = 1.5  # simulated time [s], past the top of the first bounce

    @property
    def start(self) -> Floats:
        """Initial positions of the vertices, (n, 3) [m]."""
        lift = self.height - float(self.mesh.vertices[:, 2].min())
        rows: Floats = self.mesh.vertices + np.array([0.0, 0.0, lift])
        return rows

    @property
    def volumes(self) -> Floats:
        """Volumes of the tetrahedra, (m,) [m^3]."""
        corners = self.mesh.vertices[self.mesh.tets]
        volumes: Floats = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
        return volumes

    @property
    def masses(self) -> Floats:
        """Masses of the vertices, a quarter of each adjacent tetrahedron's mass, (n,) [kg]."""
        quarters = np.repeat(self.density * self.volumes / 4.0, 4)
        masses: Floats = np.bincount(self.mesh.tets.ravel(), quarters, len(self.mesh.vertices)).astype(
            np.float64
        )
        return masses

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's parameters lambda and mu [Pa]."""
        e, nu = self.young, self.poisson
        return e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), e / (2.0 * (1.0 + nu))
