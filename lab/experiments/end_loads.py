"""Loads on the ends of a bar along x: prescribed displacements or forces, and their work.

Strains in a uniform bar are at most `STRAIN`. Stiffness is defined by work. For a displacement q, the
stiffness is the work of the reactions divided by q^2. For a force F, the stiffness is F^2 divided by the work
of F.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.sparse_gradient import Floats
from lab.experiments.statics import Equilibrium, Loading, Mask
from taichi_soft import TetMesh

STRAIN = 1e-4


@dataclass(frozen=True, eq=False)
class EndLoad:
    """A load on a bar.

    Args:
        amplitude: the displacement q [m or rad] or the force F [N].
        traction: traction on the right end, (3,) [Pa]; zero for a displacement.
    """

    loading: Loading
    amplitude: float
    traction: Floats

    def stiffness(self, settled: Equilibrium) -> float:
        """Return the stiffness, from the equilibrium under the load [N/m or N m]."""
        work = float(((settled.reactions + self.loading.forces) * settled.displacement).sum())
        return self.amplitude**2 / work if self.traction.any() else work / self.amplitude**2


def ends(mesh: TetMesh) -> tuple[Mask, Mask]:
    """Return masks of the vertices at the left and at the right end, (n,) each."""
    x = mesh.vertices[:, 0]
    reach = 1e-9 * (x.max() - x.min())
    return x - x.min() < reach, x.max() - x < reach


def held_ends(mesh: TetMesh) -> dict[str, EndLoad]:
    """Return loads by name for ends that are glued to rigid plates. One plate or both plates move."""
    left, right = ends(mesh)
    length, width = np.ptp(mesh.vertices, axis=0)[:2]
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
    none, side = np.zeros_like(y), np.where(right, 0.5, -0.5)

    def driven(q: float, *along: Any) -> EndLoad:
        return _driven(mesh, np.repeat((left | right)[:, None], 3, axis=1), q, *along)

    return {
        "tension": driven(STRAIN * length, right * 1.0, none, none),
        "shear": driven(STRAIN * length, none, none, right * 1.0),
        "torsion": driven(2 * STRAIN * length / width, none, -z * right, y * right),
        "bending": driven(2 * STRAIN * length / width, z * side, none, none),
    }


def free_ends(mesh: TetMesh) -> dict[str, EndLoad]:
    """Return loads with a known solution, by name: loads on ends that can contract or warp, and a cantilever.

    Tension and bending prescribe displacements of the ends along x only, torsion across x only. The stresses
    of a uniform bar and of Saint-Venant's theory are then exact solutions of linear elasticity up to the
    ends. In shear, displacements along z are prescribed on the whole surface, because free sides would bulge.
    """
    left, right = ends(mesh)
    length, width = np.ptp(mesh.vertices, axis=0)[:2]
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]
    none, side = np.zeros_like(y), np.where(right, 0.5, -0.5)
    along = np.zeros(mesh.vertices.shape, bool)
    along[left | right, 0] = True
    low = np.flatnonzero(left)[np.argsort(y[left] + z[left])[0]]
    next_to = np.flatnonzero(left)[np.argsort(z[left] - y[left])[0]]
    along[low, 1:] = along[next_to, 2] = True  # fix y, z and the rotation about x
    across = np.zeros(mesh.vertices.shape, bool)
    across[left | right, 1:] = True
    across[low, 0] = True
    surface = np.zeros(mesh.vertices.shape, bool)
    surface[mesh.surface] = True
    beyond = mesh.vertices[:, 0] - mesh.vertices[:, 0].min()
    root = np.repeat(left[:, None], 3, axis=1)
    pressure = STRAIN * 1e6 * width / length
    traction = np.array([0.0, 0.0, -pressure])
    loading = Loading(root, np.zeros(root.shape), end_forces(mesh, traction))
    return {
        "tension": _driven(mesh, along, STRAIN * length, side, none, none),
        "shear": _driven(mesh, surface, STRAIN * length, none, none, beyond / length),
        "torsion": _driven(mesh, across, 2 * STRAIN * length / width, none, -z * right, y * right),
        "bending": _driven(mesh, along, 2 * STRAIN * length / width, z * side, none, none),
        "cantilever": EndLoad(loading, pressure * width**2, traction),
    }


def end_forces(mesh: TetMesh, traction: Floats) -> Floats:
    """Return the vertex forces of a traction [Pa] on the right end, (n, 3) [N].

    Each corner of a triangle receives a third of the triangle's force.
    """
    _, right = ends(mesh)
    triangles: NDArray[np.int32] = mesh.surface[right[mesh.surface].all(axis=1)]
    corners = mesh.vertices[triangles]
    arms = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(arms[:, 0], arms[:, 1]), axis=1) / 2
    shares = np.bincount(triangles.ravel(), np.repeat(areas / 3, 3), len(mesh.vertices))
    return np.outer(shares, traction)


def theory(young: float, poisson: float, length: float, width: float) -> dict[str, float]:
    """Return the stiffness of a bar of square section under the loads of `free_ends`, by name.

    The formulas are E A / L, G A / L, G J / L with Saint-Venant's J, E I / L, and Timoshenko's cantilever
    with Cowper's shear coefficient of a rectangle (1966).
    """
    shear, area, inertia = young / (2 * (1 + poisson)), width**2, width**4 / 12
    odd = np.arange(1, 40, 2)
    torsion = width**4 / 3 * (1 - 192 / np.pi**5 * float((np.tanh(odd * np.pi / 2) / odd**5).sum()))
    coefficient = 10 * (1 + poisson) / (12 + 11 * poisson)
    sag = length**3 / (3 * young * inertia) + length / (coefficient * shear * area)
    return {
        "tension": young * area / length,
        "shear": shear * area / length,
        "torsion": shear * torsion / length,
        "bending": young * inertia / length,
        "cantilever": 1 / sag,
    }


def _driven(mesh: TetMesh, mask: Mask, q: float, *per_unit: Any) -> EndLoad:
    moves = np.where(mask, q * np.stack(per_unit, axis=1), 0.0)
    return EndLoad(Loading(mask, moves, np.zeros_like(moves)), q, np.zeros(3))
