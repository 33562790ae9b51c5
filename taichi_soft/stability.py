"""Largest substep that stays stable, from the frequencies of the elements at rest.

One oscillator under leapfrog with a lagging damper, x'' = -w^2 x - c x', stays bounded while
h^2 w^2 + 2 h c < 4 (the roots of z^2 - (2 - h c - h^2 w^2) z + 1 - h c lie in the unit circle). For a body
the left side is the largest eigenvalue of M^-1 (h^2 K + 2 h C), summed from its elements. The elements'
own frequencies bound it (Irons and Treharne 1971) and tell which tetrahedron is to blame; as that bound is
up to twice too strict on irregular meshes, power iteration finds the body's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_soft.errors import OptionError
from taichi_soft.forces import StillBody
from taichi_soft.laws import ElementModel, fit_model
from taichi_soft.laws.bonds import Bonds
from taichi_soft.materials import AnisotropicMaterial, AnyMaterial, Material
from taichi_soft.meshing import BodyMesh, TetMesh
from taichi_soft.scene import BodyDescription, edge_damping, rest_inverses, vertex_masses
from taichi_soft.types import DampingModel

Floats = NDArray[np.float64]
Operator = Callable[[Floats], Floats]

MARGIN = 0.9
"""Part of the linear limit that is recommended: compression stiffens an element beyond its rest value."""

_ITERATIONS = 30
_DAMPING_PASSES = 5


@dataclass(frozen=True)
class StableStep:
    """What limits the substep of one body."""

    limit: float  # [s], largest stable substep for small motion
    stiffest_tet: int | None  # whose own frequency is highest, in the caller's order
    period: float  # [s] of the fastest vibration
    stiffest_edge: tuple[int, int] | None = None  # instead of a tetrahedron where forces act along edges

    @property
    def stiffest(self) -> str:
        """What is to blame, in words."""
        if self.stiffest_edge is not None:
            return f"stiffest edge from vertex {self.stiffest_edge[0]} to {self.stiffest_edge[1]}"
        return f"stiffest tetrahedron {self.stiffest_tet}"

    @property
    def recommended(self) -> float:
        """Substep with a margin for large deformation [s]."""
        return MARGIN * self.limit


def stable_step(mesh: BodyMesh, material: AnyMaterial, model: ElementModel) -> StableStep:
    """Estimate the largest stable substep of a body under leapfrog; explicit Euler has none.

    It holds for motion about the rest shape. A body under strong compression is stiffer and a flattened
    tetrahedron has no bound at all, which is why `recommended` leaves a margin.
    Raises: MeshError, MaterialError or OptionError for what does not fit together.
    """
    if not isinstance(model, ElementModel):
        raise OptionError(f"model must come from element_model(...), got {model!r}")
    model = fit_model(model, mesh, material)
    description = BodyDescription(mesh, material, model)
    if description.bonds is not None:
        return _stable_bond_step(description, description.bonds)
    assert isinstance(mesh, TetMesh)
    assert isinstance(material, Material | AnisotropicMaterial)
    count = len(mesh.tets)
    mass = vertex_masses(mesh, material.per_tet("density", count))
    elastic = _ElasticOperator(mesh, material, mass)
    damping = _damping_operator(mesh, material, model, mass)
    u = np.random.default_rng(0).normal(size=(len(mass), 3))
    frequency2, u = _largest_eigenvalue(elastic.apply, u, _ITERATIONS)
    limit = 2.0 / np.sqrt(frequency2)
    if damping is not None:
        # Each pass makes the quadratic form h^2 K + 2 h C touch 4 along the direction that is worst so far.
        for _ in range(_DAMPING_PASSES):
            h = limit

            def form(w: Floats, h: float = h, damping: Operator = damping) -> Floats:
                return np.asarray(h * h * elastic.apply(w) + 2 * h * damping(w))

            value, u = _largest_eigenvalue(form, u, 8)
            # Between h (all damping) and h^2 (all stiffness) lies how the form grows: 2/3 is safe for both.
            limit = h * (4.0 / value) ** (2 / 3)
    worst = int(elastic.element_bounds().argmax())
    return StableStep(float(limit), worst, float(2 * np.pi / np.sqrt(frequency2)))


def _stable_bond_step(body: BodyDescription, bonds: Bonds) -> StableStep:
    """Of a law along edges. What its normals do as the body deforms is in the forces only, so they are asked:
    power iteration on their differences finds the fastest vibration. Damping is bounded edge by edge.
    """
    mesh, mass = body.mesh, body.masses
    edges = mesh.edges
    still = StillBody(body, double=True)
    nudge = 1e-6 * float(mesh.edge_lengths.min())
    rest = np.zeros_like(mesh.vertices)
    u = np.random.default_rng(0).normal(size=mesh.vertices.shape)
    growth = []
    for _ in range(_ITERATIONS):
        u /= np.linalg.norm(u, axis=1).max()
        ahead, behind = (still.forces(mesh.vertices + side * nudge * u, rest) for side in (1, -1))
        u = (behind - ahead) / (2 * nudge * mass[:, None])
        growth.append(float(np.linalg.norm(u, axis=1).max()))
    # The force need not be symmetric, and then the growth goes up and down about the largest frequency.
    frequency2 = float(np.max(growth[_ITERATIONS // 2 :]))
    per_mass = (1 / mass[edges]).sum(axis=1)
    damping = np.maximum(body.edge_damping, bonds.constants[:, 3] * bonds.is_bond)
    braking = float((np.bincount(edges.ravel(), np.repeat(2 * damping, 2), len(mass)) / mass).max())
    limit = (np.sqrt(braking**2 + 4 * frequency2) - braking) / frequency2
    along_and_across = bonds.constants[:, 1:2] if body.model.has_simple_edges else bonds.constants[:, 1:3]
    worst = int((along_and_across.max(axis=1) * per_mass).argmax())
    return StableStep(
        float(limit),
        None,
        float(2 * np.pi / np.sqrt(frequency2)),
        (int(edges[worst, 0]), int(edges[worst, 1])),
    )


class _ElasticOperator:
    """M^-1 K of a body at rest, applied tetrahedron by tetrahedron."""

    def __init__(self, mesh: TetMesh, material: Material | AnisotropicMaterial, mass: Floats) -> None:
        count = len(mesh.tets)
        self.tets = mesh.tets
        self.root_mass = np.sqrt(mass)[:, None]
        inverse = rest_inverses(mesh)
        gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)  # (m, 4, 3)
        self.strains = _strains(gradients)
        self.stiffness = material.stiffness_matrices(count)
        self.density = material.per_tet("density", count)
        volumes = mesh.volumes[:, None, None]
        self.matrices = np.swapaxes(self.strains, 1, 2) @ (volumes * self.stiffness @ self.strains)

    def element_bounds(self) -> Floats:
        """Largest w^2 of every tetrahedron on its own quarter masses, (m,) [1/s^2].

        K_e = V b^T C b, where b maps displacements to strain in Voigt's order, has the spectrum of the 6x6
        matrix L^T (b b^T) L with L L^T = C.
        """
        # Nothing beside the largest entry, but it keeps ratios near -1 and 1/2 from failing by round-off.
        floor = 1e-12 * np.abs(self.stiffness).max(axis=(1, 2))
        root = np.linalg.cholesky(self.stiffness + floor[:, None, None] * np.eye(6))
        gram = np.swapaxes(root, 1, 2) @ (self.strains @ np.swapaxes(self.strains, 1, 2)) @ root
        return np.asarray(np.linalg.eigvalsh(gram)[:, -1] * 4.0 / self.density)

    def apply(self, u: Floats) -> Floats:
        """M^-1/2 K M^-1/2 u for (n, 3) u."""
        displaced = (u / self.root_mass)[self.tets].reshape(-1, 12)
        forces = np.einsum("mij,mj->mi", self.matrices, displaced).reshape(-1, 4, 3)
        return _summed(self.tets, forces, len(u)) / self.root_mass


def _strains(gradients: Floats) -> Floats:
    """b of each tetrahedron, from the displacements of its corners to strain in Voigt's order, (m, 6, 12)."""
    b = np.zeros((len(gradients), 6, 4, 3))
    for axis in range(3):
        b[:, axis, :, axis] = gradients[:, :, axis]
    for row, (p, q) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
        b[:, row, :, p] = gradients[:, :, q]
        b[:, row, :, q] = gradients[:, :, p]
    return b.reshape(len(gradients), 6, 12)


def _damping_operator(
    mesh: TetMesh, material: Material | AnisotropicMaterial, model: ElementModel, mass: Floats
) -> Operator | None:
    """M^-1/2 C M^-1/2, or None where nothing damps."""
    tet_damping = material.per_tet("damping", len(mesh.tets))
    if not tet_damping.any():
        return None
    root_mass = np.sqrt(mass)[:, None]
    damping = edge_damping(mesh, tet_damping)
    ends = mesh.vertices[mesh.edges]
    direction = ends[:, 1] - ends[:, 0]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)

    def along_edges(u: Floats) -> Floats:
        v = (u / root_mass)[mesh.edges]
        along = damping * np.einsum("ka,ka->k", direction, v[:, 0] - v[:, 1])
        force = along[:, None] * direction
        return _summed(mesh.edges, np.stack([force, -force], axis=1), len(u)) / root_mass

    def to_the_mean(u: Floats) -> Floats:
        v = (u / root_mass)[mesh.tets]
        force = tet_damping[:, None, None] * (v - v.mean(axis=1, keepdims=True))
        return _summed(mesh.tets, force, len(u)) / root_mass

    return along_edges if model.damping_model is DampingModel.EDGE else to_the_mean


def _summed(owner: NDArray[np.int32], rows: Floats, count: int) -> Floats:
    flat = rows.reshape(-1, 3)
    return np.stack([np.bincount(owner.ravel(), flat[:, a], minlength=count) for a in range(3)], axis=1)


def _largest_eigenvalue(apply: Operator, u: Floats, iterations: int) -> tuple[float, Floats]:
    """Power iteration from `u`: the eigenvalue (from below) and its direction so far."""
    value = 0.0
    for _ in range(iterations):
        u = u / np.linalg.norm(u)
        image = apply(u)
        value = float(np.sum(u * image))
        u = image
    return value, u
