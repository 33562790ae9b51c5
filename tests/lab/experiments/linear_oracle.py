"""Linear elasticity of a tetrahedral mesh in NumPy: finite elements, for slopes at small strain."""

import numpy as np


def stiffness(mesh, young, poisson):
    """Return the stiffness matrix of all coordinates, (3 n, 3 n) [N/m]."""
    lame_lambda, mu = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    hooke = np.zeros((6, 6))
    hooke[:3, :3] = lame_lambda
    hooke += np.diag([2 * mu] * 3 + [mu] * 3)
    total = np.zeros((3 * len(mesh.vertices),) * 2)
    for tet, volume in zip(mesh.tets, mesh.volumes, strict=True):
        x = mesh.vertices[tet]
        slopes = np.linalg.inv(np.column_stack([np.ones(4), x]))[1:].T  # of the shape functions, (4, 3)
        B = np.zeros((6, 12))
        for corner, (a, b, c) in enumerate(slopes):
            B[:, 3 * corner : 3 * corner + 3] = [
                *([a, 0, 0], [0, b, 0], [0, 0, c]),
                *([b, a, 0], [0, c, b], [c, 0, a]),
            ]
        rows = (3 * tet[:, None] + np.arange(3)).ravel()
        total[np.ix_(rows, rows)] += volume * B.T @ hooke @ B
    return total


def force_on_top(mesh, young, poisson, direction):
    """Force over strain on the held top, driven in `direction`, (3,) [N]."""
    z = mesh.vertices[:, 2]
    height = np.ptp(z)
    top, bottom = z > z.max() - 1e-9, z < z.min() + 1e-9
    u = np.zeros_like(mesh.vertices)
    u[top] = np.asarray(direction) * height
    free = np.flatnonzero(np.repeat(~(top | bottom), 3))
    K = stiffness(mesh, young, poisson)
    u = u.ravel()
    u[free] = np.linalg.solve(K[np.ix_(free, free)], -(K @ u)[free])
    return (K @ u).reshape(-1, 3)[top].sum(axis=0)
