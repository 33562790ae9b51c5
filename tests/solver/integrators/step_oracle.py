"""Stiffness and damping as dense matrices, and the largest stable step from them."""

import numpy as np

from taichi_soft import internal_forces


def mass_matrix(mesh, density):
    """Diagonal of M: a quarter of every neighbouring tetrahedron, three times over."""
    m = np.zeros(len(mesh.vertices))
    for tet, rho in zip(mesh.tets, np.broadcast_to(density, len(mesh.tets)), strict=True):
        a, b, c, d = mesh.vertices[tet]
        m[tet] += rho * np.dot(b - a, np.cross(c - a, d - a)) / 24
    return np.repeat(m, 3)


def dense(mesh, material, model="edge", strain=None):
    """M^-1/2 K M^-1/2 and M^-1/2 C M^-1/2 at rest, by differences of the forces."""
    K, C = differences(mesh, material, strain=strain, damping_model=model)
    root = np.sqrt(mass_matrix(mesh, material.density))
    return K / np.outer(root, root), C / np.outer(root, root)


def differences(mesh, material, **options):
    """Return K and C at rest, from differences of the forces."""
    count = mesh.vertices.size
    K, C = np.empty((count, count)), np.zeros((count, count))
    for k in range(count):
        u = np.zeros(count)
        u[k] = 1.0
        u = u.reshape(-1, 3)
        ends = [internal_forces(mesh, material, mesh.vertices + s * u, **options) for s in (1e-6, -1e-6)]
        K[:, k] = (ends[1] - ends[0]).ravel() / 2e-6
        if np.any(material.damping):
            still = internal_forces(mesh, material, mesh.vertices, **options)
            C[:, k] = (still - internal_forces(mesh, material, mesh.vertices, u, **options)).ravel()
    return K, C


def largest_step(K, C):
    """The h whose leapfrog with lagging damper has an eigenvalue on the unit circle, by bisection.

    v' = v - h (K x + C v), x' = x + h v', written as one matrix.
    """
    one = np.eye(len(K))

    def radius(h):
        kick = np.hstack([-h * K, one - h * C])
        return np.abs(
            np.linalg.eigvals(np.vstack([np.hstack([one, np.zeros_like(K)]) + h * kick, kick]))
        ).max()

    low, high = 0.0, 4 / np.sqrt(np.linalg.eigvalsh((K + K.T) / 2)[-1])
    for _ in range(12):
        middle = (low + high) / 2
        # Rigid motion has the eigenvalue 1 twice, which round-off spreads by the root of its size.
        low, high = (middle, high) if radius(middle) < 1 + 1e-4 else (low, middle)
    return low
