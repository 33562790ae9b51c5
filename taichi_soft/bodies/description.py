"""Physical description of a body in the caller's order: masses, constants, rest shape."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import MeshError
from taichi_soft.core.math.barycentric import edge_inverses
from taichi_soft.core.types import DampingModel
from taichi_soft.elements.laws import BondLaw, ElementModel, RodLaw, ShellLaw
from taichi_soft.elements.laws.bonds import Bonds
from taichi_soft.elements.laws.rod import Rods, section
from taichi_soft.elements.laws.shell import Shells
from taichi_soft.elements.materials import (
    AnisotropicMaterial,
    AnyMaterial,
    Material,
    RigidMaterial,
    RodMaterial,
    ShellMaterial,
    SpringMaterial,
)
from taichi_soft.meshing import (
    BodyMesh,
    ParticleMesh,
    RodMesh,
    ShellMesh,
    TetMesh,
)
from taichi_soft.meshing.arrays import read_only
from taichi_soft.meshing.cage_mesh import CageMesh, lumped
from taichi_soft.meshing.shell_mesh import edges_of_triangles
from taichi_soft.meshing.splitting import InnerFaces, inner_faces

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SHORTEST_EDGE = 1e-6
"""Smallest allowed edge length of a mesh [m]. The volume of a smaller tetrahedron would be outside
float32's range."""

RIGID_SOUND_SPEED = 5000.0
"""Speed of sound in rigid bodies [m/s], that of steel. It limits how much forces can change a velocity in one
substep."""


@dataclass(frozen=True, eq=False)
class BodyDescription:
    """Mesh, material and force model of a body, independent of position and motion."""

    mesh: BodyMesh
    material: AnyMaterial
    model: ElementModel
    pinned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int32))  # vertices that stay in place

    @property
    def is_rigid(self) -> bool:
        """True for a rigid body."""
        return isinstance(self.material, RigidMaterial)

    @cached_property
    def bonds(self) -> Bonds | None:
        """Constants of the edges for a pairwise law; None for other laws."""
        law = self.model.law
        return law.bonds(self.mesh, self.material) if isinstance(law, BondLaw) else None

    @cached_property
    def shells(self) -> Shells | None:
        """Constants of the triangles of a shell; None for other bodies."""
        law = self.model.law
        return law.shells(self.mesh, self.material) if isinstance(law, ShellLaw) else None

    @cached_property
    def rods(self) -> Rods | None:
        """Constants of the edges and joints of a rod; None for other bodies."""
        law = self.model.law
        return law.rods(self.mesh, self.material) if isinstance(law, RodLaw) else None

    @cached_property
    def masses(self) -> Floats:
        """Mass of each vertex, (n,) [kg], in the caller's order, read-only."""
        if isinstance(self.mesh, ParticleMesh):
            return self.mesh.masses
        if isinstance(self.mesh, ShellMesh):
            thirds = self.mesh.areas * self.per_triangle("thickness") * self.per_triangle("density") / 3.0
            return read_only(np.bincount(self.mesh.triangles.ravel(), np.repeat(thirds, 3)))
        if isinstance(self.mesh, RodMesh):
            return self._rod_masses()
        if self.bonds is not None and self.bonds.masses is not None:
            return read_only(self.bonds.masses)
        return read_only(vertex_masses(self.mesh, self.per_tet("density")))  # type: ignore[arg-type]

    def _rod_masses(self) -> Floats:
        """Return the masses of a rod's vertices: half of the mass of each edge at the vertex."""
        assert isinstance(self.material, RodMaterial)
        count, rods = len(self.mesh.edges), self.rods
        assert rods is not None
        radius, inner, density = (
            self.material.per_edge(name, count) for name in ("radius", "inner_radius", "density")
        )
        halves = 0.5 * density * section(radius, inner)[0] * rods.edges[:count, 0]
        masses = np.zeros(len(rods.edges))
        masses[:count] += halves
        masses[(np.arange(count) + 1) % len(masses)] += halves
        return read_only(masses)

    def per_tet(self, name: str) -> Floats:
        """Return a constant of the material, multiplied by the solid fraction of each tetrahedron, (m,).

        The result is empty for a body without tetrahedra.
        """
        if not isinstance(self.mesh, TetMesh):
            return np.zeros(0)
        assert isinstance(self.material, Material | AnisotropicMaterial | RigidMaterial)
        return self.material.per_tet(name, len(self.mesh.tets)) * self.mesh.fill

    def per_triangle(self, name: str) -> Floats:
        """Return a constant of the material of a shell for each triangle, (m,)."""
        assert isinstance(self.mesh, ShellMesh)
        assert isinstance(self.material, ShellMaterial)
        return self.material.per_triangle(name, len(self.mesh.triangles))

    def stiffness_matrices(self) -> Floats:
        """Return Hooke's stiffness C of each tetrahedron, times its solid fraction, (m, 6, 6) [Pa]."""
        assert isinstance(self.mesh, TetMesh)
        assert isinstance(self.material, Material | AnisotropicMaterial)
        return self.material.stiffness_matrices(len(self.mesh.tets)) * self.mesh.fill[:, None, None]

    @cached_property
    def rest_inverses(self) -> Floats:
        """Inverse edge matrix A^-1 of each tetrahedron, (m, 3, 3) [1/m], in the caller's order, read-only."""
        return read_only(rest_inverses(self.mesh))

    @cached_property
    def sound_speed(self) -> float:
        """Speed of the fastest waves at rest [m/s].

        The speed is the largest value of sqrt((lambda + 2 mu) / density) in all tetrahedra, of
        sqrt(E / ((1 - nu^2) density)) in all triangles of a shell, or of sqrt(E / density) in all edges of a
        rod. For a `SpringMaterial`, it is the largest value of L sqrt(k / m) in all edges, where L is the
        length of an edge, k its spring constant, and m the smaller mass of its two ends.
        """
        mesh, material = self.mesh, self.material
        if isinstance(material, RigidMaterial):
            return RIGID_SOUND_SPEED
        if isinstance(material, SpringMaterial):
            assert self.bonds is not None
            ends = mesh.vertices[mesh.edges]
            lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
            lightest = self.masses[mesh.edges].min(axis=1)
            return float((lengths * np.sqrt(self.bonds.constants[:, 1] / lightest)).max())
        if isinstance(material, ShellMaterial):
            plane = self.per_triangle("young") / (1.0 - self.per_triangle("poisson") ** 2)
            return float(np.sqrt((plane / self.per_triangle("density")).max()))
        if isinstance(material, RodMaterial):
            young, density = (material.per_edge(name, len(mesh.edges)) for name in ("young", "density"))
            return float(np.sqrt((young / density).max()))
        if isinstance(material, Material):
            modulus = self.lame @ np.array([1.0, 2.0])
        else:
            modulus = self.stiffness_matrices()[:, range(3), range(3)].max(axis=1)
        return float(np.sqrt((modulus / self.per_tet("density")).max()))

    @cached_property
    def inner_faces(self) -> InnerFaces:
        """Faces along which the body can be cut."""
        return inner_faces(self.mesh.tets)

    @property
    def lame(self) -> Floats:
        """Lame's lambda and mu of each tetrahedron, (m, 2) [Pa]; zero for an anisotropic material."""
        if not isinstance(self.material, Material):
            return np.zeros((len(self.mesh.tets), 2))
        return np.stack([self.per_tet("lame_lambda"), self.per_tet("lame_mu")], axis=1)

    @property
    def stiffness(self) -> Floats:
        """The 21 constants of an anisotropic material in each tetrahedron, (m, 21) [Pa].

        They are zero for other materials.
        """
        count = len(self.mesh.tets)
        if not isinstance(self.material, AnisotropicMaterial):
            return np.zeros((count, 21))
        rows, columns = np.triu_indices(6)
        return self.stiffness_matrices()[:, rows, columns]

    @cached_property
    def edge_damping(self) -> Floats:
        """Damping constant of each edge, (k,) [N s/m]."""
        if isinstance(self.material, RodMaterial | SpringMaterial):
            return self.material.per_edge("damping", len(self.mesh.edges))
        if isinstance(self.mesh, ShellMesh):
            return shell_edge_damping(self.mesh, self.per_triangle("damping"))
        if self.model.damping_model is not DampingModel.EDGE:
            return np.zeros(len(self.mesh.edges))
        damping = edge_damping(self.mesh, self.per_tet("damping"))  # type: ignore[arg-type]
        return damping if self.bonds is None else damping * self.bonds.is_bond


def outer_vertices(mesh: BodyMesh) -> Ints:
    """Return the vertices of the surface, or all vertices of a mesh that has no inside."""
    if isinstance(mesh, TetMesh):
        return mesh.surface_vertices
    return np.arange(len(mesh.vertices), dtype=np.int32)


def edge_damping(mesh: TetMesh, tet_damping: Floats) -> Floats:
    """Return the damping constant of each edge, (k,) [N s/m]: the mean over the tetrahedra at the edge."""
    total = np.bincount(mesh.tet_edges.ravel(), np.repeat(tet_damping, 6), minlength=len(mesh.edges))
    return total / mesh.edge_valence


def shell_edge_damping(mesh: ShellMesh, damping: Floats) -> Floats:
    """Return the damping constant of each edge, (k,) [N s/m]: the mean over the triangles at the edge."""
    rows = edges_of_triangles(mesh)
    total = np.bincount(rows, np.repeat(damping, 3), minlength=len(mesh.edges))
    return total / np.bincount(rows, minlength=len(mesh.edges))


def vertex_masses(mesh: TetMesh, density: Floats) -> Floats:
    """Return the masses of the vertices, (n,) [kg]: a quarter of the mass of each adjacent tetrahedron.

    See thesis chapter 6. A vertex of a `CageMesh` has the mass of the solid that it carries.
    """
    masses = lumped(mesh.tets, mesh.volumes * density, len(mesh.vertices))
    if isinstance(mesh, CageMesh):  # mean density of the adjacent tetrahedra, times the carried volume
        masses *= mesh.vertex_volumes / lumped(mesh.tets, mesh.volumes * mesh.fill, len(mesh.vertices))
    return masses.astype(np.float64)


def rest_inverses(mesh: BodyMesh) -> Floats:
    """Return the inverse edge matrix A^-1 (thesis eq. 6.1) of each tetrahedron, (m, 3, 3) [1/m]."""
    return edge_inverses(mesh.vertices[mesh.tets])


def require_size(mesh: BodyMesh) -> None:
    """Check that no edge of a mesh is shorter than `SHORTEST_EDGE`. Raises: MeshError."""
    shortest = float(mesh.edge_lengths.min())
    if shortest < SHORTEST_EDGE:
        raise MeshError(
            f"the shortest edge is {shortest:.3g} m: scale the mesh (in metres) to {SHORTEST_EDGE:g} or more"
        )
