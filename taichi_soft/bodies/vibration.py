"""Small vibrations of a body about its rest shape: M x'' = -K x - C x', without a world."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.bodies.forces import StaticBody
from taichi_soft.core.types import DampingModel
from taichi_soft.elements.laws.rod import Rods, directions_of, rest_frames
from taichi_soft.meshing import BodyMesh, RodMesh, TetMesh
from taichi_soft.meshing.cage_mesh import lumped

Floats = NDArray[np.float64]


class Vibration(ABC):
    """Stiffness K and damping C of a free body at rest, for coordinates scaled by the root of the masses.

    K is M^-1/2 K' M^-1/2 for the unscaled stiffness K'; C is scaled in the same way. Displacements u are k
    columns, each multiplied by the root of the masses, (n, 3, k).
    """

    def __init__(self, body: BodyDescription) -> None:
        self.body = body
        self.root_mass = np.sqrt(body.masses)[:, None, None]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one displacement."""
        return (len(self.root_mass), 3, 1)

    @property
    @abstractmethod
    def is_damped(self) -> bool:
        """True if C is not zero."""

    def diagonal(self) -> Floats:
        """Return the diagonal of K up to a constant factor, (3 n,), for use as a preconditioner.

        The result can be an approximation.
        """
        return np.ones(3 * len(self.root_mass))

    @abstractmethod
    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """Return K u. If a substep `h` [s] is given, return (h^2 K + 2 h C) u, see `bodies.stability`."""


def vibration_of(body: BodyDescription) -> Vibration:
    """Return the vibrations of a body, according to its law."""
    if body.shells is not None:
        return ShellVibration(body)
    if body.rods is not None:
        return RodVibration(body, body.rods)
    return TetVibration(body) if body.bonds is None else BondVibration(body)


class TetVibration(Vibration):
    """Vibrations for a law on tetrahedra: K is the stiffness matrix of linear finite elements."""

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
        """True if any tetrahedron has damping."""
        return bool(self._damping.any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """See `Vibration.apply`."""
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
        """Return twice the elastic energy of each tetrahedron, (k, m) [J].

        Args: displaced: k displacements, not scaled by masses, (k, n, 3) [m].
        """
        corners = displaced[:, self._tets.rows].reshape(len(displaced), -1, 12)
        return np.asarray(np.einsum("kti,tij,ktj->kt", corners, self._matrices, corners, optimize=True))

    def diagonal(self) -> Floats:
        """See `Vibration.diagonal`."""
        diagonals = np.diagonal(self._matrices, axis1=1, axis2=2).reshape(-1, 4, 3, 1)
        return np.asarray(self._tets.sum(diagonals) / self.root_mass**2).ravel()

    def element_bounds(self) -> Floats:
        """Return the largest squared frequency w^2 of each tetrahedron as a separate body, (m,) [1/s^2].

        No w^2 of the whole body exceeds the largest of these bounds (Irons and Treharne 1971). A tetrahedron
        has corner masses r V density / 4. The factor r is 1 except in cages, where a vertex can carry more or
        less than a quarter of the adjacent tetrahedra. The stiffness of a tetrahedron is V b^T C b, where b
        maps displacements to strain in Voigt's order. The squared frequencies are the eigenvalues of the 6x6
        matrix 4 / density L^T (b r^-1 b^T) L with L L^T = C.
        """
        mesh, density = self.body.mesh, self.body.per_tet("density")
        assert isinstance(mesh, TetMesh)
        quarters = lumped(mesh.tets, mesh.volumes * density, len(mesh.vertices))
        ratios = np.repeat((self.body.masses / quarters)[mesh.tets], 3, axis=1)[:, None, :]
        # Without this floor, round-off can make C indefinite for Poisson's ratios near -1 and 1/2. The floor
        # is negligible relative to the largest entry.
        floor = 1e-12 * np.abs(self.stiffness).max(axis=(1, 2))
        root = np.linalg.cholesky(self.stiffness + floor[:, None, None] * np.eye(6))
        gram = np.swapaxes(root, 1, 2) @ ((self.strains / ratios) @ np.swapaxes(self.strains, 1, 2)) @ root
        return np.asarray(np.linalg.eigvalsh(gram)[:, -1] * 4.0 / density)


class _ForceVibration(Vibration):
    """Vibrations whose stiffness K comes from differences of forces."""

    def __init__(self, body: BodyDescription) -> None:
        super().__init__(body)
        self._static = StaticBody(body, double=True)
        self._offset = 1e-6 * float(body.mesh.edge_lengths.min())

    def _force_differences(self, displaced: Floats) -> Floats:
        """Return stiffness times displacements, from central differences of forces about the rest shape."""
        rest = self.body.mesh.vertices
        offset = self._offset / (np.abs(displaced).max() + 1e-300)
        zero_velocity = np.zeros_like(rest)
        ahead, behind = (self._static.forces(rest + s * offset * displaced, zero_velocity) for s in (1, -1))
        return np.asarray((behind - ahead) / (2 * offset))


class ShellVibration(_ForceVibration):
    """Vibrations of a shell. C comes from the forces of the moving rest shape, linear in its velocity."""

    @property
    def is_damped(self) -> bool:
        """True if stretching or bending is damped."""
        return bool(self.body.edge_damping.any() or self.body.per_triangle("bending_damping").any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """See `Vibration.apply`."""
        displaced, rest = u / self.root_mass, self.body.mesh.vertices
        columns = [displaced[:, :, k] for k in range(u.shape[2])]
        total = np.stack([self._force_differences(each) for each in columns], axis=2)
        if h is not None:
            damping = [-self._static.forces(rest.copy(), np.ascontiguousarray(each)) for each in columns]
            total = h * h * total + 2 * h * np.stack(damping, axis=2)
        return np.asarray(total / self.root_mass)


class RodVibration(Vibration):
    """Vibrations of a rod. Displacements have a fourth component: the angle by which an edge turns about
    itself, in the row of its first vertex.
    """

    def __init__(self, body: BodyDescription, rods: Rods) -> None:
        super().__init__(body)
        mesh = body.mesh
        assert isinstance(mesh, RodMesh)
        self._rods, count, n = rods, len(mesh.edges), len(mesh.vertices)
        inertia = np.ones((n, 1, 1))
        inertia[:count, 0, 0] = np.sqrt(rods.edges[:count, 2])
        self.root_mass = np.concatenate([np.repeat(self.root_mass, 3, axis=1), inertia], axis=1)
        self._first = np.arange(count)
        self._second = (self._first + 1) % n
        self._directions, self._lengths = directions_of(mesh)
        self._after = np.flatnonzero(rods.joints[:, 0] > 0.0)
        self._before = (self._after - 1) % n
        s = 0.25 * rods.rest[self._after, :3]
        square, identity = (s * s).sum(axis=1)[:, None, None], np.eye(3)
        change = (1.0 - square) * identity - 2.0 * cross_matrices(s) + 2.0 * s[:, :, None] * s[:, None]
        axes = matrices_of(rest_frames(mesh)[self._before])
        self._strains = change @ np.swapaxes(axes, 1, 2)  # strain of a relative rotation of two frames
        bending, torsion = rods.joints[self._after, :2].T
        self._stiffness = np.stack([bending, bending, torsion], axis=1)[:, :, None]

    @property
    def shape(self) -> tuple[int, ...]:
        """See `Vibration.shape`."""
        return (len(self.root_mass), 4, 1)

    @property
    def is_damped(self) -> bool:
        """True if stretching, bending or torsion is damped."""
        return bool(self.body.edge_damping.any() or self._rods.joints[:, 2:].any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """See `Vibration.apply`."""
        displaced, t = u / self.root_mass, self._directions[:, :, None]
        along = displaced[self._second, :3] - displaced[self._first, :3]
        lengths = self._lengths[:, None, None]
        turns = np.cross(t, along, axis=1) / lengths + displaced[self._first, 3:] * t
        bent = self._strains @ (turns[self._after] - turns[self._before])
        joints, pull = np.ones((len(bent), 1, 1)), self._rods.edges[: len(t), 1] / self._lengths
        if h is not None:
            joints = h * h + 2 * h * self._rods.joints[self._after][:, [2, 2, 3], None]
            pull = h * h * pull + 2 * h * self.body.edge_damping
        moments, total = np.zeros_like(turns), np.zeros_like(displaced)
        of_joints = np.swapaxes(self._strains, 1, 2) @ (joints * self._stiffness * bent)
        moments[self._after] += of_joints
        moments[self._before] -= of_joints
        stretched = pull[:, None, None] * (t * along).sum(axis=1, keepdims=True) * t
        forces = stretched + np.cross(moments, t, axis=1) / lengths
        total[self._second, :3] += forces
        total[self._first, :3] -= forces
        total[self._first, 3] += (moments * t).sum(axis=1)
        return np.asarray(total / self.root_mass)


def cross_matrices(vectors: Floats) -> Floats:
    """Return the matrices of the cross product with vectors, (m, 3) to (m, 3, 3)."""
    return np.asarray(np.cross(vectors[:, None, :], np.eye(3)[None], axis=2).swapaxes(1, 2))


def matrices_of(quaternions: Floats) -> Floats:
    """Return the rotation matrices of unit quaternions (x, y, z, w), (m, 4) to (m, 3, 3)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.asarray(np.array(rows).transpose(2, 0, 1))


class BondVibration(_ForceVibration):
    """Vibrations for a law along edges.

    The stiffness includes the rotation of the planes in the laws of chapter 4.
    """

    def __init__(self, body: BodyDescription) -> None:
        super().__init__(body)
        assert body.bonds is not None
        self._along, across = body.edge_damping, None
        if not body.model.has_simple_edges:
            # The planes rotate, so each damping constant can act in any direction.
            self._along = across = np.maximum(self._along, body.bonds.constants[:, 3] * body.bonds.is_bond)
        self._dampers = _EdgeDampers(body.mesh, self._along, across)

    @property
    def is_damped(self) -> bool:
        """True if any edge has damping."""
        return bool(self._along.any())

    def apply(self, u: Floats, h: float | None = None) -> Floats:
        """See `Vibration.apply`."""
        displaced = u / self.root_mass
        total = np.stack([self._force_differences(displaced[:, :, k]) for k in range(u.shape[2])], axis=2)
        if h is not None:
            total = h * h * total + 2 * h * self._dampers.apply(displaced)
        return np.asarray(total / self.root_mass)


class _EdgeDampers:
    """Damping matrix of dampers at the edges of a mesh.

    The damping constants act along each edge, and optionally across it, (k,) [N s/m] each.
    """

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
        """Return the damping matrix times velocities [m/s], (n, 3, k) [N]."""
        ends = velocities[self._edges.rows]
        force = self._matrices @ (ends[:, 0] - ends[:, 1])
        return self._edges.sum(np.stack([force, -force], axis=1))


class _Owners:
    """Sums of rows that belong to the same vertex, such as forces on the corners of tetrahedra."""

    def __init__(self, rows: NDArray[np.int32], count: int) -> None:
        self.rows = rows
        owners = rows.ravel()
        self._order = np.argsort(owners, kind="stable")
        self._present, self._starts = np.unique(owners[self._order], return_index=True)
        self._count = count

    def sum(self, forces: Floats) -> Floats:
        """Sum the forces on c corners of m elements, (m, c, 3, k), by vertex, (n, 3, k)."""
        flat = forces.reshape(-1, *forces.shape[2:])[self._order]
        total = np.zeros((self._count, *forces.shape[2:]))
        total[self._present] = np.add.reduceat(flat, self._starts, axis=0)
        return total


def _strains(rest_inverses: Floats) -> Floats:
    """Return the matrix b of each tetrahedron, (m, 6, 12). It maps corner displacements to Voigt strain."""
    gradients = np.concatenate([-rest_inverses.sum(axis=1, keepdims=True), rest_inverses], axis=1)
    b = np.zeros((len(gradients), 6, 4, 3))
    for axis in range(3):
        b[:, axis, :, axis] = gradients[:, :, axis]
    for row, (p, q) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
        b[:, row, :, p] = gradients[:, :, q]
        b[:, row, :, q] = gradients[:, :, p]
    return b.reshape(len(gradients), 6, 12)
