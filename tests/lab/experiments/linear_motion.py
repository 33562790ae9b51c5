"""Small motions about the rest shape, from linear elasticity in NumPy."""

import numpy as np


def quadratic_form(mesh, young, poisson, density, damping, h):
    """h^2 K + 2 h C over the lumped masses, (3 n, 3 n), with K and C written out from linear elasticity."""
    n = len(mesh.vertices)
    mass, K, C = np.zeros(n), np.zeros((n, 3, n, 3)), np.zeros((n, 3, n, 3))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    one = np.eye(3)
    for tet in mesh.tets:
        shape = np.column_stack([mesh.vertices[tet], np.ones(4)])
        slopes = np.linalg.inv(shape)[:3].T  # of the four linear functions, (4, 3)
        volume = abs(np.linalg.det(shape)) / 6
        mass[tet] += density * volume / 4
        dots = slopes @ slopes.T
        block = lam * np.einsum("ia,jb->iajb", slopes, slopes) + mu * np.einsum("ib,ja->iajb", slopes, slopes)
        block += mu * np.einsum("ij,ab->iajb", dots, one)
        K[np.ix_(tet, range(3), tet, range(3))] += volume * block
    for p, q in mesh.edges:
        along = mesh.vertices[q] - mesh.vertices[p]
        part = damping * np.outer(along, along) / (along @ along)
        for i, j, sign in ((p, p, 1), (q, q, 1), (p, q, -1), (q, p, -1)):
            C[i, :, j] += sign * part
    form = (h * h * K + 2 * h * C).reshape(3 * n, 3 * n)
    root = np.sqrt(np.repeat(mass, 3))
    return form / root[:, None] / root
