"""Stiffness of a body in any direction, computed from the work of a uniform stretch along that direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_soft import Material, TetMesh, internal_forces
from taichi_soft.core.types import LawName

Floats = NDArray[np.float64]

STRETCH = 0.002
"""Relative stretch. It is so small that the measured stiffness is that at rest."""


def directions(count: int) -> Floats:
    """Return unit vectors spread evenly over a hemisphere (Fibonacci lattice), (count, 3)."""
    i = np.arange(count) + 0.5
    z, turn = i / count, i * np.pi * (3 - 5**0.5)
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)


def stretch_modulus(mesh: TetMesh, material: Material, law: LawName, direction: Floats) -> float:
    """Return the stiffness against a stretch without lateral contraction [Pa].

    The stiffness is twice the work per volume and squared strain. For an isotropic material it equals lambda
    + 2 mu. The work is computed from the forces at half the stretch.
    """
    move = STRETCH * np.outer(mesh.vertices @ direction, direction)
    forces = internal_forces(mesh, material, mesh.vertices + move / 2, law=law)
    return float(-2 * np.sum(forces * move) / (STRETCH**2 * mesh.volume))


def spread(values: Floats | list[float]) -> float:
    """Return the difference of the largest and the smallest value, divided by the mean."""
    return float(np.ptp(values) / np.mean(values))
