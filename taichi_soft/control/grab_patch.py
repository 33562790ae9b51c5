"""The part of a body that a hand takes hold of, and how strongly that may be pulled: numpy only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.control.kernels.grabs import PATCH_ROWS
from taichi_soft.elements.materials import SpringMaterial

PATCH_SIZE = 0.25
"""Radius of a patch over the diagonal of the body: about the hold of a hand."""

FARTHEST_PULL = 0.5
"""How far a patch may be pulled out of the body, over its radius, by the estimate below. Measured: elements
then stretch by a quarter or a third, which the longest stable substeps still bear; at four times that they
tear."""


@dataclass(frozen=True)
class Patch:
    """Vertices round a point, with their shares of a pull, which add up to 1."""

    vertices: NDArray[np.int32]
    shares: NDArray[np.float64]
    strength: float  # [N] that moves it by `FARTHEST_PULL` of its radius against the rest of the body


def patch_round(body: BodyDescription, corners: NDArray[np.int32], weights: NDArray[np.float64]) -> Patch:
    """The patch round a point at rest, given in barycentric coordinates of three or four vertices."""
    mesh = body.mesh
    distance = np.linalg.norm(mesh.vertices - weights @ mesh.vertices[corners], axis=1)
    radius = max(
        PATCH_SIZE * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))), 1.2 * distance[corners].max()
    )
    if (distance < radius).sum() > PATCH_ROWS:
        radius = float(np.partition(distance, PATCH_ROWS)[PATCH_ROWS])
    falloff = np.maximum(1 - (distance / radius) ** 2, 0) ** 2
    falloff[falloff < 1e-6] = 0
    vertices = np.flatnonzero(falloff).astype(np.int32)
    shares = (falloff * body.masses)[vertices]
    strength = FARTHEST_PULL * radius * _stiffness(body, falloff)
    return Patch(vertices, shares / shares.sum(), strength)


def _stiffness(body: BodyDescription, falloff: NDArray[np.float64]) -> float:
    """Force per distance [N/m] by which particles moved each by its `falloff` w are held back, at least.

    Twice the energy of that shape per distance squared: sum V mu |grad w|^2 in tetrahedra; in springs
    sum k (w_i - w_j)^2 / 3, as a third of them lies along any direction.
    """
    mesh: Any = body.mesh
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        step = falloff[mesh.edges]
        return float(body.bonds.constants[:, 1] @ (step[:, 1] - step[:, 0]) ** 2 / 3)
    corner = falloff[mesh.tets]
    near = np.flatnonzero(corner.any(axis=1))
    ends = mesh.vertices[mesh.tets[near]]
    rise = (corner[near, 1:] - corner[near, :1])[..., None]
    slope = np.linalg.solve(ends[:, 1:] - ends[:, :1], rise)[..., 0]
    return float((mesh.volumes[near] * _shear_moduli(body)[near]) @ (slope**2).sum(axis=1))


def _shear_moduli(body: BodyDescription) -> NDArray[np.float64]:
    """The smallest of each tetrahedron, (m,) [Pa]."""
    moduli = body.stiffness_matrices()
    return np.asarray(moduli[:, range(3, 6), range(3, 6)].min(axis=1))


def wave_speed(body: BodyDescription) -> float:
    """With which what is done to a part of a body reaches the rest, at least [m/s].

    sqrt(mu / density); in springs, a sqrt(k / m) of the mean edge a and the mean mass m.
    """
    mesh: Any = body.mesh
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        ends = mesh.vertices[mesh.edges]
        edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
        return float(edge * np.sqrt(body.bonds.constants[:, 1].min() / body.masses.mean()))
    return float(np.sqrt(_shear_moduli(body).min() * mesh.volumes.sum() / body.masses.sum()))
