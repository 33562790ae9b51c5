"""The laws of thesis chapter 6 once more, in NumPy float64, from the equations, one tetrahedron at a time."""

import numpy as np

FACES = (
    (1, 2, 3),
    (0, 3, 2),
    (0, 1, 3),
    (0, 2, 1),
)  # opposite to vertex i, outward where the volume is positive


def tet_forces(rest, now, young, poisson, strain="linear", flips="tolerant"):
    """(4, 3) forces: stress times a third of the outward area vector of each opposite face.

    Principal stretches are ascending here, so a recovering tetrahedron counts the first one negative and turns
    the sign of the other two stresses.
    """
    A = np.stack([rest[k] - rest[0] for k in (1, 2, 3)], axis=1)
    B = np.stack([now[k] - now[0] for k in (1, 2, 3)], axis=1)
    F = B @ np.linalg.inv(A)
    is_flipped = np.linalg.det(B) < 0
    w, axes = np.linalg.eigh(F @ F.T)
    s = np.sqrt(np.maximum(w, 0.0))
    if is_flipped and flips == "recover":
        s[0] = -s[0]
    e = s - 1.0 if strain == "exact" else np.where(s < 0, s - 0.5, 0.5 * (s * s - 1.0))
    lam = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = young / (2 * (1 + poisson))
    stress = lam * e.sum() + 2 * mu * e
    if is_flipped and flips == "recover":
        stress[1:] *= -1
    if is_flipped and flips == "tolerant":
        stress *= -1
    tensor = axes @ np.diag(stress) @ axes.T
    return np.array([tensor @ np.cross(now[b] - now[a], now[c] - now[a]) / 6.0 for a, b, c in FACES])


def body_forces(mesh, material, now, strain="linear", flips="tolerant"):
    """(n, 3) elastic forces of a whole mesh."""
    total = np.zeros_like(mesh.vertices)
    young = material.per_tet("young", len(mesh.tets))
    poisson = material.per_tet("poisson", len(mesh.tets))
    for t, corners in enumerate(mesh.tets):
        total[corners] += tet_forces(
            mesh.vertices[corners], now[corners], young[t], poisson[t], strain, flips
        )
    return total


def edge_damping(mesh, damping, x, v):
    """(n, 3) eq. 3.9: b n (n . dv) along each edge, b the mean over the tetrahedra that share it."""
    total = np.zeros_like(x)
    sharing: dict = {}
    for t, corners in enumerate(mesh.tets):
        for i in range(4):
            for j in range(i):
                sharing.setdefault(frozenset((int(corners[i]), int(corners[j]))), []).append(damping[t])
    for edge, values in sharing.items():
        p, q = edge
        n = (x[q] - x[p]) / np.linalg.norm(x[q] - x[p])
        force = np.mean(values) * n * (n @ (v[q] - v[p]))
        total[p] += force
        total[q] -= force
    return total


def tet_mean_damping(mesh, damping, v):
    """(n, 3) of every tetrahedron: b times (mean velocity - velocity) on each corner."""
    total = np.zeros_like(v)
    for t, corners in enumerate(mesh.tets):
        total[corners] += damping[t] * (v[corners].mean(axis=0) - v[corners])
    return total
