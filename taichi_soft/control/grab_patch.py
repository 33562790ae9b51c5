"""The part of a body that a grab holds, and the largest force on it. Numpy only.

Sums have an explicit order, so that the native library is bit-identical.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.control.kernels.grabs import PATCH_ROWS
from taichi_soft.core.math.rotations import length_of
from taichi_soft.elements.materials import SpringMaterial

PATCH_SIZE = 0.25
"""Radius of a patch over the diagonal of the body, about the size of a hand's grip."""

FARTHEST_PULL = 0.5
"""Largest displacement of a patch over its radius, by the estimate below. Elements then stretch by a quarter
to a third, which is stable with the longest stable substeps; four times as much is not."""


@dataclass(frozen=True)
class Patch:
    """Vertices around a point, with their shares of the force, which have the sum 1."""

    vertices: NDArray[np.int32]
    shares: NDArray[np.float64]
    strength: (
        float  # force that moves it by `FARTHEST_PULL` of its radius relative to the rest of the body [N]
    )


def patch_around(body: BodyDescription, corners: NDArray[np.int32], weights: NDArray[np.float64]) -> Patch:
    """Make the patch around a rest point, given in barycentric coordinates of three or four vertices."""
    x = body.mesh.vertices
    distance = _lengths(x - point_between(x[corners], weights))
    radius = max(PATCH_SIZE * length_of(np.ptp(x, axis=0)), 1.2 * float(distance[corners].max()))
    if (distance < radius).sum() > PATCH_ROWS:
        radius = float(np.partition(distance, PATCH_ROWS)[PATCH_ROWS])
    part = distance / radius
    falloff = np.maximum(1 - part * part, 0)
    falloff = falloff * falloff
    falloff[falloff < 1e-6] = 0
    vertices = np.flatnonzero(falloff).astype(np.int32)
    shares = (falloff * body.masses)[vertices]
    strength = FARTHEST_PULL * radius * _stiffness(body, falloff)
    return Patch(vertices, shares / _sum(shares), strength)


def point_between(corners: NDArray[Any], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Point with barycentric coordinates (k,) among corners (k, 3), in float64."""
    point = np.zeros(3)
    for corner, weight in zip(corners.astype(np.float64), weights.tolist(), strict=True):
        point += weight * corner
    return point


def elements_of(body: BodyDescription) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Vertices and stiffness of each element, which resist the patch's motion.

    Returns: springs (e, 2) and k / 3 [N/m], as a third of them lies along any direction; or tetrahedra (m, 4)
    and V mu [N m].
    """
    mesh: Any = body.mesh
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        return mesh.edges, body.bonds.constants[:, 1] / 3
    return mesh.tets, mesh.volumes * _shear_moduli(body)


def _stiffness(body: BodyDescription, falloff: NDArray[np.float64]) -> float:
    """Lower bound of the stiffness [N/m] against moving each particle by its `falloff` w.

    Twice the energy of that shape per distance squared: sum V mu |grad w|^2 in tetrahedra; in springs
    sum k (w_i - w_j)^2 / 3.
    """
    elements, stiffness = elements_of(body)
    near = np.flatnonzero(falloff[elements].any(axis=1))
    elements, stiffness = elements[near], stiffness[near]
    corner = falloff[elements]
    rise = [corner[:, i] - corner[:, 0] for i in range(1, elements.shape[1])]
    if len(rise) == 1:
        return _sum(stiffness * (rise[0] * rise[0]))
    ends = body.mesh.vertices[elements]
    a, b, c = (ends[:, i] - ends[:, 0] for i in range(1, 4))
    across = _cross(b, c), _cross(c, a), _cross(a, b)
    volume = _sum_of_three(a.T, across[0])
    slope = [_sum_of_three(rise, [each[k] for each in across]) / volume for k in range(3)]
    return _sum(stiffness * _sum_of_three(slope, slope))


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Components of the cross products of rows (n, 3)."""
    x, y, z = (a[:, k] for k in range(3))
    u, v, w = (b[:, k] for k in range(3))
    return [y * w - z * v, z * u - x * w, x * v - y * u]


def _sum_of_three(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Sum of three products, in order."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _lengths(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    columns = rows.T
    return np.asarray(np.sqrt(_sum_of_three(columns, columns)))


def _sum(numbers: NDArray[np.float64]) -> float:
    """Sum in order."""
    return float(np.cumsum(numbers)[-1])


def _shear_moduli(body: BodyDescription) -> NDArray[np.float64]:
    """Smallest shear modulus of each tetrahedron, (m,) [Pa]."""
    moduli = body.stiffness_matrices()
    return np.asarray(moduli[:, range(3, 6), range(3, 6)].min(axis=1))


def wave_speed(body: BodyDescription) -> float:
    """Lower bound of the wave speed in a body [m/s].

    sqrt(mu / density); for springs, a sqrt(k / m) with the mean edge a and the mean mass m.
    """
    mesh: Any = body.mesh
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        ends = mesh.vertices[mesh.edges]
        edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
        return float(edge * np.sqrt(body.bonds.constants[:, 1].min() / body.masses.mean()))
    return float(np.sqrt(_shear_moduli(body).min() * mesh.volumes.sum() / body.masses.sum()))
