"""Implicit Euler with scipy, for comparison: sparse assembly of all tetrahedra, and conjugate gradients.

Only the virial law with the linear strain is supported, for normal and inverted tetrahedra in free fall. The
code is written in numpy from the equations in `laws.force_gradients` and `kernels.rigid_rotation`,
independently of the kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import edge_damping, rest_inverses, vertex_masses
from taichi_soft.core.constants import GRAVITY_EARTH
from taichi_soft.core.extras import require_extra
from taichi_soft.elements.materials import Material
from taichi_soft.meshing import TetMesh
from taichi_soft.solver.kernels.rigid_rotation import THIN

Floats = NDArray[np.float64]


def require_scipy() -> Any:
    """Return scipy.sparse. Raises: MissingExtraError if scipy is not installed."""
    require_extra("voronoi", "this comparison needs")
    import scipy.sparse.linalg

    return scipy.sparse


class SparseBody:
    """One body in float64 that is stepped with sparse matrices of scipy."""

    def __init__(self, mesh: TetMesh, material: Material) -> None:
        self._sparse = require_scipy()
        count = len(mesh.tets)
        self.mesh = mesh
        self.positions = mesh.vertices.copy()
        self.velocities = np.zeros_like(self.positions)
        self._lame = [material.per_tet(name, count) for name in ("lame_lambda", "lame_mu")]
        self._inverse = rest_inverses(mesh)
        self._gradients = np.concatenate(
            [-self._inverse.sum(axis=1, keepdims=True), self._inverse], axis=1
        )  # gradients at the four corners, (m, 4, 3)
        self._masses = vertex_masses(mesh, material.per_tet("density", count))
        self._damping = edge_damping(mesh, material.per_tet("damping", count))
        index = 3 * mesh.tets[:, :, None] + np.arange(3)
        self._rows = np.repeat(index.reshape(count, 12), 12, axis=1).ravel()
        self._columns = np.tile(index.reshape(count, 12), (1, 12)).ravel()
        ends = 3 * mesh.edges[:, :, None] + np.arange(3)
        self._edge_rows = np.repeat(ends.reshape(-1, 6), 6, axis=1).ravel()
        self._edge_columns = np.tile(ends.reshape(-1, 6), (1, 6)).ravel()

    def step(self, h: float, tolerance: float) -> None:
        """Make one implicit step of `h` [s]."""
        forces, stiffness = self._forces(), self._stiffness()
        damping = self._damping_matrix()
        v = self.velocities.ravel()
        forces = forces.ravel() - damping @ v
        forces[2::3] -= GRAVITY_EARTH * self._masses
        masses = self._sparse.diags(np.repeat(self._masses, 3))
        plain = (masses + h * damping).tocsr()
        split_off, split_off_transposed = self._rotation_splits(h)

        def stiffness_beside_rotation(change: Floats) -> Floats:
            return split_off_transposed(stiffness @ split_off(change))

        system = self._sparse.linalg.LinearOperator(
            plain.shape, lambda change: plain @ change + h * h * stiffness_beside_rotation(change)
        )
        inverse = self._sparse.diags(1.0 / (plain.diagonal() + h * h * stiffness.diagonal()))
        change, _ = self._sparse.linalg.cg(
            system, h * (forces - h * stiffness_beside_rotation(v)), rtol=tolerance, M=inverse
        )
        self.velocities += change.reshape(-1, 3)
        self.positions += h * self.velocities

    def _rotation_splits(self, h: float) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
        """Return two functions that multiply a vector by P = 1 - W J W^T M and by P^T. See
        `kernels.rigid_rotation`.
        """
        mass, total = np.repeat(self._masses, 3), self._masses.sum()
        arms = self.positions - self._masses @ self.positions / total
        W = np.stack([np.cross(axis, arms).ravel() for axis in np.eye(3)], axis=1)
        inertia = W.T @ (mass[:, None] * W)
        added = THIN * np.trace(inertia) + total * (h * h * GRAVITY_EARTH) ** 2
        J = np.linalg.inv(inertia + added * np.eye(3))
        return lambda v: v - W @ (J @ (W.T @ (mass * v))), lambda f: f - mass * (W @ (J @ (W.T @ f)))

    def _deformations(self) -> Floats:
        corners = self.positions[self.mesh.tets]
        return np.asarray(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2) @ self._inverse)

    def _forces(self) -> Floats:
        """Return the elastic forces on the vertices, f_i = -V0 P g_i with P = sigma cof F. P is negated for
        inverted tetrahedra.
        """
        F = self._deformations()
        strain = 0.5 * (F @ np.swapaxes(F, 1, 2) - np.eye(3))
        lame_lambda, lame_mu = (value[:, None, None] for value in self._lame)
        trace = np.einsum("maa->m", strain)[:, None, None]
        stress = lame_lambda * trace * np.eye(3) + 2 * lame_mu * strain
        J = np.linalg.det(F)[:, None, None]
        piola = np.sign(J) * stress @ (J * np.swapaxes(np.linalg.inv(F), 1, 2))
        rows = -self.mesh.volumes[:, None, None] * np.einsum("mab,mib->mia", piola, self._gradients)
        total = np.zeros_like(self.positions)
        np.add.at(total, self.mesh.tets, rows)
        return np.asarray(total)

    def element_stiffness(self) -> Floats:
        """Return the projected stiffness matrix of every tetrahedron, (m, 12, 12) [N/m]."""
        U, s, Vt = np.linalg.svd(self._deformations())
        for turned in (np.linalg.det(U) < 0, np.linalg.det(Vt) < 0):
            s[turned, 2] *= -1
        U[np.linalg.det(U) < 0, :, 2] *= -1
        Vt[np.linalg.det(Vt) < 0, 2] *= -1
        lame_lambda, lame_mu = (value[:, None] for value in self._lame)
        mirror = np.stack([np.ones(len(s)), np.ones(len(s)), np.where(s[:, 2] < 0, -1.0, 1.0)], axis=1)
        t = s * mirror
        strain = 0.5 * (t * t - 1)
        stress = lame_lambda * strain.sum(axis=1, keepdims=True) + 2 * lame_mu * strain
        others = t[:, [1, 0, 0]] * t[:, [2, 2, 1]]
        p = stress * others * mirror
        M = (
            others[:, :, None]
            * (lame_lambda[:, :, None] + 2 * lame_mu[:, :, None] * np.eye(3))
            * t[:, None, :]
        )
        for a, b, c in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
            M[:, a, b] += stress[:, a] * t[:, c]
            M[:, b, a] += stress[:, b] * t[:, c]
        M *= mirror[:, :, None] * mirror[:, None, :]
        largest = 10 * (2 * self._lame[1] + np.abs(self._lame[0]))
        H = np.zeros((len(s), 3, 3, 3, 3))
        for a, b in ((0, 1), (0, 2), (1, 2)):
            gap, total = s[:, a] - s[:, b], s[:, a] + s[:, b]
            near = np.abs(gap) <= 1e-3 * (np.abs(s[:, a]) + np.abs(s[:, b]))
            limit = 0.5 * (M[:, a, a] - M[:, a, b] + M[:, b, b] - M[:, b, a])
            shear = np.where(near, limit, (p[:, a] - p[:, b]) / np.where(near, 1, gap))
            rotation = np.clip((p[:, a] + p[:, b]) / np.maximum(total, 1e-9), 0, largest)
            alpha, beta = 0.5 * (np.maximum(shear, 0) + rotation), 0.5 * (np.maximum(shear, 0) - rotation)
            H[:, a, b, a, b] = H[:, b, a, b, a] = alpha
            H[:, a, b, b, a] = H[:, b, a, a, b] = beta
        values, axes = np.linalg.eigh((M + np.swapaxes(M, 1, 2)) / 2)
        M = np.einsum("mak,mk,mbk->mab", axes, np.maximum(values, 0), axes)
        for a in range(3):
            for b in range(3):
                H[:, a, a, b, b] = M[:, a, b]
        g = np.einsum("mab,mib->mia", Vt, self._gradients)
        inner = np.einsum("mabcd,mib,mjd->miajc", H, g, g, optimize=True)
        blocks = np.einsum("mxa,miajc,myc->mixjy", U, inner, U, optimize=True)
        return np.asarray(blocks.reshape(-1, 12, 12) * self.mesh.volumes[:, None, None])

    def _stiffness(self) -> Any:
        shape = (self.positions.size, self.positions.size)
        return self._sparse.coo_matrix(
            (self.element_stiffness().ravel(), (self._rows, self._columns)), shape=shape
        ).tocsr()

    def _damping_matrix(self) -> Any:
        ends = self.positions[self.mesh.edges]
        n = ends[:, 1] - ends[:, 0]
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        nn = self._damping[:, None, None] * n[:, :, None] * n[:, None, :]
        blocks = np.block([[nn, -nn], [-nn, nn]])
        shape = (self.positions.size, self.positions.size)
        return self._sparse.coo_matrix(
            (blocks.ravel(), (self._edge_rows, self._edge_columns)), shape=shape
        ).tocsr()
