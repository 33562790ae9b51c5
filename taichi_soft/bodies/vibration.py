"""Small vibrations of a body about its rest shape: M x'' = -K x - C x', without a world."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.forces import StillBody
from taichi_soft.core.types import DampingModel
from taichi_soft.meshing import BodyMesh, TetMesh
from taichi_soft.meshing.cage_mesh import lumped

Floats = NDArray[np.float64]


class Vibration(ABC):
    """K and C of a body at rest, which nothing holds, each scaled as M^-1/2 K M^-1/2.

    Displacements are (n, 3, k): k of them at once, each times the root of the masses.
    """

    def __init__(self, body: BodyDescription) -> None:
        self.body = body
        self.root_mass = np.sqrt(body.masses)[:, None, None]

    @property
    @abstractmethod
    def is_damped(self) -> bool:
        """Whether C is not zero."""

    def diagonal(self) -> Floats:
        """About the diagonal of K, (3 n,) [1/s^2], up to a factor: to precondition with."""
        return np.ones(3 * len(self.root_mass))

    @abstractmethod
    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """K u [1/s^2]; with `h` [s] what decides a substep of that length, (h^2 K + 2 h C) u."""


def vibration_of(body: BodyDescription) -> Vibration:
    """That of a body, by its law."""
    return TetVibration(body) if body.bonds is None else BondVibration(body)


class TetVibration(Vibration):
    """Of a law on tetrahedra: K is that of linear finite elements, tetrahedron by tetrahedron."""

    def __init__(self, body: BodyDescription) -> None:
        super().__init__(body)
        mesh = body.mesh
        assert isinstance(mesh, TetMesh)
        self.strains = _strains(body.rest_inverses)
        self.stiffness = body.stiffness_matrices()
        volumes = mesh.volumes[:, None, None]
        self._matrices = np.swapaxes(self.strains, 1, 2) @ (volumes * self.stiffness @ self.strains)
        self._tets = _Owners(mesh.tets, len(mesh.vertices))
        self._damping = body.per_tet("damping")
        self._dampers = None
        if body.model.damping_model is DampingModel.EDGE:
            self._dampers = _EdgeDampers(body.mesh, body.edge_damping)

    @property
    def is_damped(self) -> bool:
        """Whether any tetrahedron damps."""
        return bool(self._damping.any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """As `Vibration.apply`."""
        displaced = u / self.root_mass
        corners = displaced[self._tets.rows]
        forces = (self._matrices @ corners.reshape(len(corners), 12, -1)).reshape(corners.shape)
        if h is not None:
            forces *= h * h
            if self._dampers is None:
                b = self._damping.reshape(-1, 1, 1, 1)
                forces += 2 * h * b * (corners - corners.mean(axis=1, keepdims=True))
        total = self._tets.sum(forces)
        if h is not None and self._dampers is not None:
            total += 2 * h * self._dampers.apply(displaced)
        return np.asarray(total / self.root_mass)

    def energies(self, displaced: Floats) -> Floats:
        """u^T K u of each tetrahedron for displacements (k, n, 3) [m]: twice their energy, (k, m) [J]."""
        corners = displaced[:, self._tets.rows].reshape(len(displaced), -1, 12)
        return np.asarray(np.einsum("kti,tij,ktj->kt", corners, self._matrices, corners, optimize=True))

    def diagonal(self) -> Floats:
        """As `Vibration.diagonal`."""
        own = np.diagonal(self._matrices, axis1=1, axis2=2).reshape(-1, 4, 3, 1)
        return np.asarray(self._tets.sum(own) / self.root_mass**2).ravel()

    def element_bounds(self) -> Floats:
        """Largest w^2 of every tetrahedron on its own share of the masses of its vertices, (m,) [1/s^2]: none
        of the body is above the largest (Irons and Treharne 1971).

        K_e = V b^T C b, where b maps displacements to strain in Voigt's order, has on corner masses
        r V density / 4 the spectrum of the 6x6 matrix 4 / density L^T (b r^-1 b^T) L with L L^T = C. The
        ratios r are 1 but in cages, whose vertices carry more or less than a quarter of what is round them.
        """
        mesh, density = self.body.mesh, self.body.per_tet("density")
        assert isinstance(mesh, TetMesh)
        quarters = lumped(mesh.tets, mesh.volumes * density, len(mesh.vertices))
        ratios = np.repeat((self.body.masses / quarters)[mesh.tets], 3, axis=1)[:, None, :]
        # Nothing beside the largest entry, but it keeps ratios near -1 and 1/2 from failing by round-off.
        floor = 1e-12 * np.abs(self.stiffness).max(axis=(1, 2))
        root = np.linalg.cholesky(self.stiffness + floor[:, None, None] * np.eye(6))
        gram = np.swapaxes(root, 1, 2) @ ((self.strains / ratios) @ np.swapaxes(self.strains, 1, 2)) @ root
        return np.asarray(np.linalg.eigvalsh(gram)[:, -1] * 4.0 / density)


class BondVibration(Vibration):
    """Of a law along edges. What its planes do as a body deforms is in the forces only, so they are asked."""

    def __init__(self, body: BodyDescription) -> None:
        super().__init__(body)
        assert body.bonds is not None
        self._still = StillBody(body, double=True)
        self._nudge = 1e-6 * float(body.mesh.edge_lengths.min())
        self._along, across = body.edge_damping, None
        if not body.model.has_simple_edges:
            # The planes turn, so that either damping may act in any direction.
            self._along = across = np.maximum(self._along, body.bonds.constants[:, 3] * body.bonds.is_bond)
        self._dampers = _EdgeDampers(body.mesh, self._along, across)

    @property
    def is_damped(self) -> bool:
        """Whether any edge damps."""
        return bool(self._along.any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """As `Vibration.apply`."""
        displaced = u / self.root_mass
        total = np.stack([self._pull(displaced[:, :, k]) for k in range(u.shape[2])], axis=2)
        if h is not None:
            total = h * h * total + 2 * h * self._dampers.apply(displaced)
        return np.asarray(total / self.root_mass)

    def _pull(self, displaced: Floats) -> Floats:
        """Central differences of the forces at rest."""
        rest = self.body.mesh.vertices
        nudge = self._nudge / (np.abs(displaced).max() + 1e-300)
        still = np.zeros_like(rest)
        ahead, behind = (self._still.forces(rest + s * nudge * displaced, still) for s in (1, -1))
        return np.asarray((behind - ahead) / (2 * nudge))


class _EdgeDampers:
    """Dampers along edges, and across them where given [N s/m], of (k,) edges."""

    def __init__(self, mesh: BodyMesh, along: Floats, across: Floats | None = None) -> None:
        ends = mesh.vertices[mesh.edges]
        direction = ends[:, 1] - ends[:, 0]
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        self._matrices = along[:, None, None] * direction[:, :, None] * direction[:, None]
        if across is not None:
            others = np.eye(3) - direction[:, :, None] * direction[:, None]
            self._matrices = self._matrices + across[:, None, None] * others
        self._edges = _Owners(mesh.edges, len(mesh.vertices))

    def apply(self, velocities: Floats) -> Floats:
        """What they brake with, (n, 3, k) [N], of velocities [m/s]."""
        ends = velocities[self._edges.rows]
        force = self._matrices @ (ends[:, 0] - ends[:, 1])
        return self._edges.sum(np.stack([force, -force], axis=1))


class _Owners:
    """Sums of rows, such as forces on the corners of tetrahedra, over those of the same vertex."""

    def __init__(self, rows: NDArray[np.int32], count: int) -> None:
        self.rows = rows
        owners = rows.ravel()
        self._order = np.argsort(owners, kind="stable")
        self._present, self._starts = np.unique(owners[self._order], return_index=True)
        self._count = count

    def sum(self, forces: Floats) -> Floats:
        """(m, c, 3, k) -> (n, 3, k)."""
        flat = forces.reshape(-1, *forces.shape[2:])[self._order]
        total = np.zeros((self._count, *forces.shape[2:]))
        total[self._present] = np.add.reduceat(flat, self._starts, axis=0)
        return total


def _strains(rest_inverses: Floats) -> Floats:
    """b of each tetrahedron, from the displacements of its corners to strain in Voigt's order, (m, 6, 12)."""
    gradients = np.concatenate([-rest_inverses.sum(axis=1, keepdims=True), rest_inverses], axis=1)
    b = np.zeros((len(gradients), 6, 4, 3))
    for axis in range(3):
        b[:, axis, :, axis] = gradients[:, :, axis]
    for row, (p, q) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
        b[:, row, :, p] = gradients[:, :, q]
        b[:, row, :, q] = gradients[:, :, p]
    return b.reshape(len(gradients), 6, 12)
