"""Stiffness of a tetrahedral mesh, and the first mode of a free body, with SciPy."""

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags, identity
from scipy.sparse.linalg import eigsh


def lumped_masses(mesh, density):
    """Return the mass of each vertex, a quarter of the mass of each adjacent tetrahedron, (n,) [kg]."""
    x = mesh.vertices[mesh.tets]
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    return np.bincount(mesh.tets.ravel(), np.repeat(volumes * density / 4, 4), len(mesh.vertices))


def assembled_stiffness(mesh, young, poisson):
    """Return the stiffness matrix of linear finite elements, sparse (3n, 3n) [N/m].

    `young` is one number, or one number for each tetrahedron.
    """
    young = np.broadcast_to(young, len(mesh.tets))[:, None, None, None, None]
    lame, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    x = mesh.vertices[mesh.tets]
    gradients = np.linalg.inv(np.concatenate([np.ones((len(x), 4, 1)), x], axis=2))[:, 1:].swapaxes(1, 2)
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    dots = gradients @ gradients.swapaxes(1, 2)
    blocks = lame * np.einsum("tia,tjb->tiajb", gradients, gradients)
    blocks += mu * np.einsum("tib,tja->tiajb", gradients, gradients)
    blocks += mu * np.einsum("tij,ab->tiajb", dots, np.eye(3))
    blocks = (volumes[:, None, None, None, None] * blocks).reshape(len(x), 12, 12)
    places = (3 * mesh.tets[:, :, None] + np.arange(3)).reshape(len(x), 12)
    rows, columns = (np.broadcast_to(p, blocks.shape) for p in (places[:, :, None], places[:, None]))
    count = 3 * len(mesh.vertices)
    return coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), (count, count)).tocsc()


def first_mode(K, mass):
    """Return the angular frequency [rad/s] and the shape (n, 3) of the slowest vibration of a free body."""
    root = np.repeat(np.sqrt(mass), 3)
    scaled = csc_matrix(diags(1 / root) @ csc_matrix(K) @ diags(1 / root))
    shift = 1e-3 * scaled.diagonal().min()
    # Six of the seven smallest values are equal. Lanczos iterations for seven values can miss the seventh.
    start = np.random.default_rng(0).normal(size=len(root))
    values, vectors = eigsh(scaled + shift * identity(len(root), format="csc"), k=12, sigma=0.0, v0=start)
    order = np.argsort(values)
    omega = np.sqrt(values[order[6]] - shift)
    return omega, (vectors[:, order[6]] / root).reshape(-1, 3)
