"""Quantities derived from a body's state. They are computed in float64 from float32 fields."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_soft.bodies.kernels.rods import read_frames
from taichi_soft.bodies.pose import Pose, best_fitting_pose
from taichi_soft.bodies.present import edge_constants_of, lame_of, rods_of, shells_of, stiffness_of
from taichi_soft.bodies.soft_body import SoftBody, context_of, record_of, require_alive, rest_inverses_of
from taichi_soft.core.checks import as_vector
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.elements.kernels.stress import compute_stress
from taichi_soft.elements.laws.law import EnergyLaw
from taichi_soft.elements.laws.rod import directions_at, followed_rows, half_strains
from taichi_soft.elements.materials import voigt_stress
from taichi_soft.meshing import RodMesh, TetMesh
from taichi_soft.meshing.cage_mesh import lumped
from taichi_soft.meshing.rigid_mesh import RigidMesh
from taichi_soft.meshing.sections import section_areas

Floats = NDArray[np.float64]


def require_tets(body: SoftBody) -> None:
    """Check that a body has tetrahedra that deform. Raises: MeshError."""
    if body.asset.description.is_rigid:
        raise MeshError(f"body {body.index} is rigid: it has neither strain nor stress")
    if len(body.tets) == 0:
        raise MeshError(f"body {body.index} has no tetrahedra: it consists of particles and edges only")


def positions_of(body: SoftBody) -> Floats:
    """Return the positions of the vertices of a body, (n, 3) [m], in float64."""
    return body.exact_positions()


def velocities_of(body: SoftBody) -> Floats:
    """Return the velocities of the vertices of a body, (n, 3) [m/s], in float64."""
    return body.velocities().astype(np.float64)


def tet_volumes(body: SoftBody) -> Floats:
    """See `Body.volumes`."""
    volumes = np.linalg.det(_edge_vectors(body)) / 6.0
    return np.asarray(body.mesh.fill * volumes if isinstance(body.mesh, RigidMesh) else volumes)


def _edge_vectors(body: SoftBody) -> Floats:
    """Return vectors from the first to the other vertices of each tetrahedron, as rows, (m, 3, 3) [m]."""
    corners = positions_of(body)[body.tets]
    return np.asarray(corners[:, 1:] - corners[:, :1])


def pose(body: SoftBody) -> Pose:
    """See `Body.pose`."""
    return best_fitting_pose(body.mesh.vertices, positions_of(body), body.masses)


def angular_momentum(body: SoftBody) -> Floats:
    """See `Body.angular_momentum`."""
    impulses = body.masses[:, None] * velocities_of(body)
    total = np.cross(positions_of(body), impulses).sum(axis=0)
    if isinstance(body.mesh, RodMesh):
        _, spins = _frames_of(body)
        directions, _ = directions_at(body.mesh, positions_of(body))
        count = len(directions)
        total = total + (rods_of(body).edges[:count, 2] * spins[:count]) @ directions
    return np.asarray(total)


def kinetic_energy(body: SoftBody) -> float:
    """See `Body.kinetic_energy`."""
    energy = float(0.5 * body.masses @ (velocities_of(body) ** 2).sum(axis=1))
    if isinstance(body.mesh, RodMesh):
        energy += float(0.5 * rods_of(body).edges[:, 2] @ _frames_of(body)[1] ** 2)
    return energy


def gravitational_energy(body: SoftBody) -> float:
    """See `Body.gravitational_energy`."""
    gravity = context_of(body).settings.gravity * body.gravity_scale
    return float(-(body.masses @ positions_of(body)) @ gravity)


def tet_mesh(body: SoftBody) -> TetMesh:
    """Return the mesh of a body that consists of tetrahedra."""
    assert isinstance(body.mesh, TetMesh), "meshes without tetrahedra are refused earlier"
    return body.mesh


def elastic_energy(body: SoftBody) -> float:
    """See `Body.elastic_energy`."""
    model, bonds = record_of(body).description.model, record_of(body).description.bonds
    law = model.law
    if body.asset.description.is_rigid:
        return 0.0
    if bonds is not None and law.name == "springs":
        ends = positions_of(body)[body.mesh.edges]
        constants = edge_constants_of(body)
        elongation = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) - constants[:, 0]
        return float(0.5 * constants[:, 1] @ elongation**2)
    if record_of(body).description.shells is not None:
        return shell_energy(body)
    if isinstance(body.mesh, RodMesh):
        return rod_energy(body, body.mesh)
    if isinstance(law, EnergyLaw) and not model.is_anisotropic:
        return float(law.energy_density(deformations(body), *lame_of(body).T) @ tet_mesh(body).volumes)
    strain, stress = green_strain_and_stress(body)
    return float(0.5 * np.einsum("mab,mab->m", strain, stress) @ tet_mesh(body).volumes)


def shell_energy(body: SoftBody) -> float:
    """Return the elastic energy of a shell [J]: see `laws.shell`."""
    shells = shells_of(body)
    x = positions_of(body)[shells.points]
    d = x[:, 1:] - x[:, :1]
    inverse, (lam, mu) = shells.rest_inverse, shells.lame.T
    f1 = d[:, 0] * inverse[:, :1]
    f2 = d[:, 0] * inverse[:, 1:2] + d[:, 1] * inverse[:, 2:]
    e11, e22, e12 = ((a * b).sum(axis=1) / 2 for a, b in ((f1, f1), (f2, f2), (f1, f2)))
    e11, e22 = e11 - 0.5, e22 - 0.5
    stretching = lam / 2 * (e11 + e22) ** 2 + mu * (e11**2 + e22**2 + 2 * e12**2)
    weights, c = shells.bending[:, :15].reshape(-1, 3, 5), shells.bending[:, 15:]
    q = weights @ d - c[:, :, None] * np.cross(d[:, 0], d[:, 1])[:, None]
    return float(stretching.sum() + 0.5 * (q**2).sum())


def _frames_of(body: SoftBody) -> tuple[Floats, Floats]:
    """Return the frames (n, 4) and the spins (n,) [rad/s] of a rod's edges, see `elements.kernels.rods`."""
    frames = np.zeros((body.vertex_count, 4), dtype=np.float32)
    spins = np.zeros(body.vertex_count, dtype=np.float32)
    if context_of(body).fields is not None:
        context_of(body).built.read(body.index, read_frames, frames, spins)
    return frames.astype(np.float64), spins.astype(np.float64)


def rod_energy(body: SoftBody, mesh: RodMesh) -> float:
    """Return the elastic energy of a rod [J]: see `laws.rod`."""
    if context_of(body).fields is None:  # the body is at rest until the world is built
        return 0.0
    rods, count = rods_of(body), len(mesh.edges)
    directions, lengths = directions_at(mesh, positions_of(body))
    frames = followed_rows(_frames_of(body)[0][:count], directions)
    rest, stiffness = rods.edges[:count, :2].T
    stretching = 0.5 * stiffness / rest @ (lengths - rest) ** 2
    after = np.flatnonzero(rods.joints[:, 0] > 0.0)
    strains = 4.0 * half_strains(frames[(after - 1) % len(rods.rest)], frames[after]) - rods.rest[after, :3]
    return float(stretching + 0.5 * (rods.joints[after][:, [0, 0, 1]] * strains**2).sum())


def green_strain_and_stress(body: SoftBody) -> tuple[Floats, Floats]:
    """Return Green's strain 1/2 (F^T F - I) and the stress of Hooke's law [Pa], (m, 3, 3) each.

    The tensors are in the axes of the rest shape. They are independent of the body's force law: see
    `Body.elastic_energy`.
    """
    F = deformations(body)
    strain = 0.5 * (np.swapaxes(F, 1, 2) @ F - np.eye(3))
    return strain, voigt_stress(stiffness_of(body), strain)


def tet_stresses(body: SoftBody) -> Floats:
    """See `Body.stresses`."""
    F = deformations(body)
    stress = np.empty_like(F)
    compute_stress(record_of(body).description.model, F, stiffness_of(body), stress)
    return stress


def force_across(body: SoftBody, point: ArrayLike, normal: ArrayLike) -> Floats:
    """See `Body.force_across`."""
    origin, direction = as_vector(point, "point", "m"), as_vector(normal, "normal", "(any length)")
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        raise OptionError("normal is zero: pass a direction across the plane")
    direction = direction / length
    stress = tet_stresses(body)
    heights = (positions_of(body)[body.tets] - origin) @ direction
    areas = section_areas(heights, np.abs(tet_volumes(body)))
    return np.asarray(np.einsum("mab,b,m->a", stress, direction, areas))


def deformations(body: SoftBody) -> Floats:
    """See `Body.deformations`."""
    require_tets(body)
    return np.asarray(np.swapaxes(_edge_vectors(body), 1, 2) @ rest_inverses_of(body))


def strains(body: SoftBody) -> Floats:
    """See `Body.strains`."""
    F = deformations(body)
    return np.asarray(0.5 * (F @ np.swapaxes(F, 1, 2) - np.eye(3)))


def plastic_strains(body: SoftBody) -> Floats:
    """See `Body.plastic_strains`."""
    require_alive(body)
    require_tets(body)
    plastic = np.linalg.inv(rest_inverses_of(body)) @ record_of(body).description.rest_inverses  # Fp
    stretches = np.linalg.svd(plastic, compute_uv=False)
    return np.asarray(np.sqrt(2.0 / 3.0) * np.linalg.norm(np.log(stretches), axis=1))


def tet_stress(body: SoftBody) -> Floats:
    """See `Body.tet_stress`."""
    return np.asarray(np.sqrt(1.5) * _deviator_norms(tet_stresses(body)))


def tet_strain(body: SoftBody) -> Floats:
    """See `Body.tet_strain`."""
    return np.asarray(np.sqrt(2.0 / 3.0) * _deviator_norms(strains(body)))


def _deviator_norms(tensors: Floats) -> Floats:
    """Return the norm sqrt(e:e) of the deviator e of each of the `tensors`, (m,)."""
    deviators = tensors - np.einsum("maa->m", tensors)[:, None, None] / 3.0 * np.eye(3)
    return np.asarray(np.linalg.norm(deviators, axis=(1, 2)))


def vertex_means(body: SoftBody, values: Floats) -> Floats:
    """Return the mean of `values` (m,) over the tetrahedra around each vertex, weighted by volume, (n,)."""
    mesh, n = tet_mesh(body), body.vertex_count
    return np.asarray(lumped(mesh.tets, values * mesh.volumes, n) / lumped(mesh.tets, mesh.volumes, n))
