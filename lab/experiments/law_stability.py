"""Stability of a body under a law, from its vibrations at rest and from a run."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from taichi_soft import FrozenBodyWarning, Material, TetMesh, UnstableStepWarning, internal_forces
from taichi_soft.core.types import LawName
from taichi_soft.world.bare import bare_world

STEPS = 200
GROWTH = 3.0
"""A body counts as unstable if a small random displacement grows by more than this factor within `STEPS`
steps."""

SHORTEST, LONGEST, HALVINGS = 0.25, 1.4, 7
"""Bounds of the search for the largest stable step [estimated step], and number of bisections. Seven
bisections find the step to 1 %."""


@dataclass(frozen=True)
class Vibration:
    """Small undamped vibrations about the rest shape."""

    frequency: float  # highest angular frequency [1/s]
    growth_rate: float  # largest growth rate [1/s]; under a law without an energy, vibrations can grow


def vibration(mesh: TetMesh, material: Material, law: LawName) -> Vibration:
    """Compute the vibrations from all eigenvalues of M^-1 K, with K by finite differences of the forces."""
    count = mesh.vertices.size
    nudge = 1e-6 * float(mesh.edge_lengths.min())
    stiffness = np.empty((count, count))
    for k in range(count):
        move = np.zeros(count)
        move[k] = nudge
        behind, ahead = (
            internal_forces(mesh, material, mesh.vertices + side * move.reshape(-1, 3), law=law)
            for side in (-1, 1)
        )
        stiffness[:, k] = (behind - ahead).ravel() / (2 * nudge)
    mass = np.repeat(bare_world(floor=None, retries=0).add_body(mesh, material, law=law).masses, 3)
    squares = np.linalg.eigvals(stiffness / mass[:, None])
    squares = squares[np.abs(squares) > 1e-6 * np.abs(squares).max()]  # removes rigid motions
    roots = np.sqrt(squares.astype(complex))
    return Vibration(float(roots.real.max()), float(np.abs(roots.imag).max()))


class ShakenBody:
    """A body that can be run repeatedly from small random displacements."""

    def __init__(self, mesh: TetMesh, material: Material, law: LawName) -> None:
        """Build a world without gravity."""
        self.world = bare_world(gravity=(0, 0, 0), floor=None, retries=0)
        self.body = self.world.add_body(mesh, material, law=law)
        self.world.build()
        self.rest = mesh.vertices
        size = 1e-4 * mesh.edge_lengths.min()
        self.noise = size * np.random.default_rng(0).normal(size=self.rest.shape)

    def stays(self, h: float) -> bool:
        """True if the body stays close to its rest shape over `STEPS` leapfrog steps of length h [s]."""
        far = GROWTH * np.abs(self.noise).max()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnstableStepWarning)
            warnings.simplefilter("ignore", FrozenBodyWarning)
            self.body.set_motion(self.rest + self.noise, np.zeros_like(self.noise))
            for _ in range(STEPS // 20):
                self.world.step(20 * h, 20)
                if self.body.is_frozen or np.abs(self.body.positions() - self.rest).max() > far:
                    return False
        return True

    def largest_step(self) -> float:
        """Return the largest stable step [s]; 0 if the body is unstable at `SHORTEST`."""
        guess = self.body.stable_step.limit
        low, high = SHORTEST * guess, LONGEST * guess
        if not self.stays(low):
            return 0.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.stays(middle) else (low, middle)
        return low
