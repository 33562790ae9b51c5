"""Equilibria of a body under any law, without time steps.

Some coordinates are prescribed, and forces act on the other coordinates. Newton's method runs in float64,
with the stiffness from central differences of the forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.experiments.sparse_gradient import Floats, SparseGradient
from taichi_soft import LAWS, Material, TetMesh, internal_forces
from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.core.types import LawName, StrainName
from taichi_soft.elements.laws import BondLaw
from taichi_soft.elements.laws.bonds import Ring

Mask = NDArray[np.bool_]

STEP = 1e-5
"""Step of the finite differences, as a fraction of the shortest edge. Truncation and rounding each cause a
relative error of about 1e-10."""
SLOW = 0.5
"""The stiffness is computed again if a step of Newton's method leaves more than this fraction of the
residual."""
MOST_STEPS, MOST_HALVINGS = 30, 6
FAR = 100.0
"""A body counts as unconstrained if the first step of Newton's method displaces it by more than this multiple
of its size."""


class NoEquilibriumError(TaichiSoftError):
    """No equilibrium was found: the stiffness is singular, or Newton's method failed."""


@dataclass(frozen=True, eq=False)
class Loading:
    """Loads and prescribed coordinates of a body.

    Args:
        driven: True for prescribed coordinates, (n, 3).
        displacement: displacements of the driven coordinates from rest, (n, 3) [m]; other entries are
            ignored.
        forces: forces on the other coordinates, (n, 3) [N].
    """

    driven: Mask
    displacement: Floats
    forces: Floats


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A state in which all forces balance.

    Args:
        displacement: displacement from rest, (n, 3) [m].
        reactions: forces that hold the driven coordinates, (n, 3) [N]; zero elsewhere.
        residual: largest unbalanced force, as a fraction of the largest force.
    """

    displacement: Floats
    reactions: Floats
    residual: float


class StaticBody:
    """A mesh with a material and a law. Loadings with the same `driven` share one factorised stiffness."""

    def __init__(
        self, mesh: TetMesh, material: Material, law: LawName, strain: StrainName | None = None
    ) -> None:
        """Create the body at rest."""
        self.mesh, self.material = mesh, material
        self._law, self._strain = law, strain
        self._gradient = SparseGradient(
            _dependence(mesh, material, law), STEP * float(mesh.edge_lengths.min())
        )
        self._at_rest: Any = None
        self._solvers: dict[bytes, Any] = {}

    def forces(self, displacement: Floats) -> Floats:
        """Return the internal forces, (n, 3) [N]."""
        positions = self.mesh.vertices + displacement
        return np.asarray(
            internal_forces(self.mesh, self.material, positions, law=self._law, strain=self._strain)
        )

    def stiffness(self, displacement: Floats | None = None) -> Any:
        """Return -df/dx at a displacement, by default at rest: a sparse matrix (3n, 3n) [N/m]."""
        if displacement is not None:
            return -self._gradient.at(self.forces, displacement)
        if self._at_rest is None:
            self._at_rest = -self._gradient.at(self.forces, np.zeros_like(self.mesh.vertices))
        return self._at_rest

    def equilibrium(self, loading: Loading, tolerance: float = 1e-7) -> Equilibrium:
        """Find the equilibrium.

        Args:
            tolerance: largest `Equilibrium.residual`; the law "best_fitting_plane" reaches only about 1e-8.
        Raises: NoEquilibriumError.
        """
        free = ~loading.driven.ravel()
        stiffness = self.stiffness()
        u = np.where(loading.driven, loading.displacement, 0.0)
        pull = loading.forces.ravel() - stiffness @ u.ravel()
        solve = self._solver(loading.driven)
        u.ravel()[free] += solve(pull[free])
        if not np.abs(u).max() < FAR * float(np.ptp(self.mesh.vertices)):
            raise NoEquilibriumError("the stiffness is singular, or the loads are far too large")
        inner, residual = self._balance(u, loading)
        for _ in range(MOST_STEPS):
            if residual <= tolerance:
                reactions = np.where(loading.driven, -inner, 0.0)
                return Equilibrium(u, reactions, residual)
            step = np.zeros(u.size)
            step[free] = solve((inner + loading.forces).ravel()[free])
            before = residual
            for halvings in range(MOST_HALVINGS):
                trial = u + step.reshape(u.shape) * 0.5**halvings
                inner, residual = self._balance(trial, loading)
                if residual < before:
                    break
            u = trial
            if residual > SLOW * before:
                solve = factorised(self.stiffness(u)[free][:, free])
        raise NoEquilibriumError(f"out of balance by {residual:.2g} of the largest force")

    def _balance(self, u: Floats, loading: Loading) -> tuple[Floats, float]:
        inner = self.forces(u)
        out = np.where(loading.driven, 0.0, inner + loading.forces)
        largest = max(float(np.abs(inner).max()), float(np.abs(loading.forces).max()), 1e-300)
        return inner, float(np.abs(out).max()) / largest

    def _solver(self, driven: Mask) -> Any:
        key = driven.tobytes()
        if key not in self._solvers:
            free = ~driven.ravel()
            self._solvers[key] = factorised(self.stiffness()[free][:, free])
        return self._solvers[key]


def factorised(matrix: Any) -> Any:
    """Factorise a sparse matrix. Returns: a function that solves the linear system for a right-hand side.

    Raises: NoEquilibriumError for a singular matrix.
    """
    from scipy.sparse.linalg import splu

    try:
        factors = splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01)
    except RuntimeError as error:
        raise NoEquilibriumError(f"the stiffness is singular ({error})") from None
    return factors.solve


def _dependence(mesh: TetMesh, material: Material, law: LawName) -> Any:
    """Return a sparse, symmetric (n, n) matrix: non-zero for vertices whose forces depend on each other."""
    from scipy.sparse import coo_matrix

    chosen = LAWS[law]
    owners: list[NDArray[Any]] = [np.repeat(np.arange(len(mesh.tets)), 4)]
    vertices: list[NDArray[Any]] = [mesh.tets.ravel()]
    if isinstance(chosen, BondLaw) and chosen.ring not in (Ring.NONE, Ring.EXPANSION):
        bonds = chosen.bonds(mesh, material)  # a bond depends on its ring and its ends
        given = bonds.ring_members >= 0
        edges = np.arange(len(mesh.edges))
        owners += [len(mesh.tets) + np.repeat(edges, 2)]
        owners += [len(mesh.tets) + np.broadcast_to(bonds.ring_edge[:, None], given.shape)[given]]
        vertices += [mesh.edges.ravel(), bonds.ring_members[given]]
    rows, columns = np.concatenate(owners), np.concatenate(vertices)
    shape = (rows.max() + 1, len(mesh.vertices))
    reads = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=shape).tocsr()
    return (reads.T @ reads).tocsr()
