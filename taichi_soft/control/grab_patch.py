"""Patch of a grab: the part of a body that the grab pulls, and the strength of this part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.bodies.description import BodyDescription
from taichi_soft.control.kernels.grab_patch import shape_patch
from taichi_soft.elements.materials import RodMaterial, ShellMaterial, SpringMaterial
from taichi_soft.meshing import ShellMesh
from taichi_soft.meshing.shell_mesh import edges_of_triangles

PATCH_SIZE = 0.25
"""Radius of a patch, as a fraction of the diagonal of the body's bounding box. With this radius, a patch
is about the size of a hand's grip."""

FARTHEST_PULL = 0.5
"""Largest estimated displacement of a patch, as a fraction of its radius. At this displacement, elements
stretch by a quarter to a third, which is stable with the longest stable substeps. Four times this
displacement is unstable."""

LIMITS = np.array([PATCH_SIZE, 1.2, 1e-6, FARTHEST_PULL])
"""Constants for `shape_patch`. In this order: `PATCH_SIZE`; smallest radius of a patch, as a multiple of
the distance between the point and the farthest corner; smallest falloff of a vertex in a patch;
`FARTHEST_PULL`."""


STRONGEST = 1e20
"""Strength of the patch of a rigid body [N]."""


@dataclass(frozen=True)
class Patch:
    """Vertices around a grabbed point, and the fraction of the force that each vertex gets."""

    vertices: NDArray[np.int32]  # (k,)
    shares: NDArray[np.float64]  # (k,), fractions of the force, which sum to 1
    strength: float  # force that moves the patch by `FARTHEST_PULL` times its radius [N]


def patch_around(body: BodyDescription, corners: NDArray[np.int32], weights: NDArray[np.float64]) -> Patch:
    """Return the patch around a point at rest, which has barycentric coordinates `weights` in `corners`.

    The patch of a rigid body is its four vertices, and has no limit of strength.
    """
    if body.is_rigid:
        return Patch(corners.astype(np.int32), weights, STRONGEST)
    elements, stiffness = elements_of(body)
    rows, strength = np.empty((len(body.masses), 2)), np.empty(1)
    x = np.ascontiguousarray(body.mesh.vertices)
    shape_patch(corners, weights, LIMITS, x, body.masses, elements, stiffness, rows, strength)
    vertices = np.flatnonzero(rows[:, 0]).astype(np.int32)
    return Patch(vertices, rows[vertices, 1], float(strength[0]))


def point_between(corners: NDArray[Any], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the point with barycentric coordinates `weights` (k,) in corners (k, 3), in float64."""
    point = np.zeros(3)
    for corner, weight in zip(corners.astype(np.float64), weights.tolist(), strict=True):
        point += weight * corner
    return point


def elements_of(body: BodyDescription) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Return the vertices of each element, and the element's stiffness against the motion of a patch.

    The stiffness of a spring or of an edge of a rod, (e, 2), is k / 3 [N/m], because a third of the springs
    acts along any direction. The stiffness of a tetrahedron, (m, 4), is V mu [N m]. The elements of a shell
    are its edges. The sum of k (w_i - w_j)^2 over these edges is the sum of A t mu |grad w|^2 over the
    triangles (Pinkall and Polthier 1993).
    """
    mesh: Any = body.mesh
    if body.is_rigid:
        return mesh.tets, np.zeros(len(mesh.tets))
    if isinstance(mesh, ShellMesh):
        return mesh.edges, _cotangent_stiffness(body, mesh)
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        return mesh.edges, body.bonds.constants[:, 1] / 3
    if body.rods is not None:
        length, stiffness = body.rods.edges[: len(mesh.edges), :2].T
        return mesh.edges, stiffness / length / 3
    return mesh.tets, mesh.volumes * _shear_moduli(body)


def _cotangent_stiffness(body: BodyDescription, mesh: ShellMesh) -> NDArray[np.float64]:
    """Return the stiffness of the edges of a shell, (k,) [N/m]: see `elements_of`. It is never negative."""
    young, nu, thickness = (body.per_triangle(name) for name in ("young", "poisson", "thickness"))
    strength, total = young / (2.0 * (1.0 + nu)) * thickness, np.zeros(len(mesh.edges))
    rows, x = edges_of_triangles(mesh).reshape(-1, 3), mesh.vertices[mesh.triangles]
    for k in range(3):
        p, q = x[:, (k + 1) % 3] - x[:, k], x[:, (k + 2) % 3] - x[:, k]
        cotangent = (p * q).sum(axis=1) / (2.0 * mesh.areas)
        total += np.bincount(rows[:, k], 0.5 * strength * cotangent, minlength=len(mesh.edges))
    return np.maximum(total, 0.0)


def _shear_moduli(body: BodyDescription) -> NDArray[np.float64]:
    """Return the smallest of the three shear moduli of each tetrahedron, (m,) [Pa]."""
    moduli = body.stiffness_matrices()
    return np.asarray(moduli[:, range(3, 6), range(3, 6)].min(axis=1))


def wave_speed(body: BodyDescription) -> float:
    """Return a lower bound of the wave speed in a body [m/s].

    The bound is sqrt(mu / density), for shells as well, and sqrt(E / density) for rods. For springs, it is
    L sqrt(k / m), with the mean edge length L and the mean mass m.
    """
    mesh: Any = body.mesh
    if body.is_rigid:
        return body.sound_speed
    if isinstance(body.material, SpringMaterial):
        assert body.bonds is not None
        ends = mesh.vertices[mesh.edges]
        edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
        return float(edge * np.sqrt(body.bonds.constants[:, 1].min() / body.masses.mean()))
    if isinstance(body.material, RodMaterial):
        young, density = (body.material.per_edge(name, len(mesh.edges)) for name in ("young", "density"))
        return float(np.sqrt((young / density).min()))
    if isinstance(body.material, ShellMaterial):
        mu = body.per_triangle("young") / (2.0 * (1.0 + body.per_triangle("poisson")))
        return float(np.sqrt((mu / body.per_triangle("density")).min()))
    return float(np.sqrt(_shear_moduli(body).min() * mesh.volumes.sum() / body.masses.sum()))
