"""Forces of deformed bodies, written again in NumPy float64 straight from the equations.

Nothing of taichi_soft is called here but the mesh's `vertices` and `tets`, so that a mistake there cannot
hide. Thesis sections 6.1 to 6.4 with the corrections: sigma = 1/V sum x f^T, and the force on a vertex is
sigma times a third of the outward area vector of the face opposite to it.
"""

from itertools import combinations

import numpy as np
import pytest

from taichi_soft import Material, TetMesh, box, sphere, torus

LAWS = ("virial", "face")
STRAINS = ("linear", "exact")
FLIPS = ("tolerant", "off", "recover")
MODES = [(law, strain, flips) for law in LAWS for strain in STRAINS for flips in FLIPS]
SOAKS = [
    *(("virial", "exact", flips) for flips in ("tolerant", "off")),
    *(("face", "linear", flips) for flips in ("tolerant", "off")),
    *(("face", "exact", flips) for flips in FLIPS),
]
"""Modes that `make test` leaves to `make test-all`: each of their choices is in another mode, too."""

ONE_TET = TetMesh([[0.1, 0.0, 0.0], [1.2, 0.1, -0.1], [0.2, 0.9, 0.0], [0.3, 0.2, 1.1]], [[0, 1, 2, 3]])
MESHES = {
    "tet": ONE_TET,
    "box": box((1.0, 0.7, 1.3), (2, 2, 2)),
    "sphere": sphere(0.7, 2),
    "torus": torus(1.0, 0.4, 2, 8),
}

# The face opposite to each vertex, wound so that its right-hand normal points out of an upright tetrahedron.
OPPOSITE_FACES = ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))


EACH_STRAIN = ("linear", pytest.param("exact", marks=pytest.mark.soak))
"""Strains of tests whose modes with "exact" no other test of `make test` compiles."""


def params_of(modes):
    """Parameters of a test, one for each mode."""
    return [
        pytest.param(*mode, id="-".join(mode), marks=pytest.mark.soak if mode in SOAKS else ())
        for mode in modes
    ]


def lame(young, poisson):
    """Lame's constants from E and nu [Pa]."""
    return young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)


def hooke(strain, lame_lambda, lame_mu):
    """Stress of an isotropic material [Pa]."""
    return lame_lambda * np.trace(strain) * np.eye(3) + 2 * lame_mu * strain


def stress_of(F, strain, lame_lambda, lame_mu):
    """Stress from the singular values of F [Pa]."""
    axes, stretches, _ = np.linalg.svd(F)
    strains = (stretches**2 - 1) / 2 if strain == "linear" else stretches - 1
    return (axes * np.diag(hooke(np.diag(strains), lame_lambda, lame_mu))) @ axes.T


def recovery_energy(rest, corners, modulus):
    """Return the energy of an inverted tetrahedron under `recover` [J].

    The energy is V M/2 |F - R|^2, with the nearest rotation R.

    If the tetrahedron is inverted by less than 1/16 of its thickness, the slope of the energy decreases
    linearly to zero.
    """
    F = deformation(rest, corners)
    axes, stretches, turn = np.linalg.svd(F)
    axes[:, 2] *= np.linalg.det(axes @ turn)
    s = -stretches[2]
    kept = (1 + s * 16) ** 2 / 32 if s > -1 / 16 else 0.0  # of a triangle of slopes, 1 high and 1/16 wide
    return signed_volume(rest) * modulus * (np.sum((F - axes @ turn) ** 2) / 2 + kept)


def recovering_forces(rest, corners, modulus):
    """Minus the slope of `recovery_energy` in its principal axes [N]."""
    axes, stretches, turn = np.linalg.svd(deformation(rest, corners))
    axes[:, 2] *= -1
    s = -stretches[2]
    pulls = np.array([stretches[0] - 1, stretches[1] - 1, s - 1 if s < -1 / 16 else 17 * s])
    inverse = np.linalg.inv((rest[1:] - rest[0]).T)
    rows = np.vstack([-inverse.sum(axis=0), inverse])
    return -signed_volume(rest) * modulus * rows @ (axes * pulls @ turn).T


def strain_by_root(F, kind):
    """Return the strain of upright bodies in one formula each: 1/2 (F F^T - I), or sqrt(F F^T) - I."""
    square = F @ F.T
    if kind == "linear":
        return (square - np.eye(3)) / 2
    values, axes = np.linalg.eigh(square)
    return (axes * np.sqrt(values)) @ axes.T - np.eye(3)


def area_vectors(corners):
    """Area vectors of the faces opposite to each of four corners, outward if upright, (4, 3) [m^2]."""
    return (
        np.array([np.cross(corners[b] - corners[a], corners[c] - corners[a]) for a, b, c in OPPOSITE_FACES])
        / 2
    )


def signed_volume(corners):
    """Volume of one tetrahedron, negative if it is inside out [m^3]."""
    return np.dot(corners[1] - corners[0], np.cross(corners[2] - corners[0], corners[3] - corners[0])) / 6


def volume_gradient(corners):
    """Derivative of `signed_volume` with respect to each corner, (4, 3) [m^2].

    It points against the outward normal of the opposite face.
    """
    return -area_vectors(corners) / 3


def deformation(rest, corners):
    """Return F, which maps the edges of the rest shape to those of the deformed shape."""
    return np.linalg.solve((rest[1:] - rest[0]), (corners[1:] - corners[0])).T


def elastic_forces(mesh, young, poisson, positions, strain="linear", flips="tolerant"):
    """Elastic forces on all vertices, (n, 3) [N]; `young` and `poisson` one number or one per tetrahedron."""
    count = len(mesh.tets)
    forces = np.zeros((len(mesh.vertices), 3))
    for tet, E, nu in zip(
        mesh.tets, np.broadcast_to(young, count), np.broadcast_to(poisson, count), strict=True
    ):
        corners = positions[tet]
        lame_lambda, lame_mu = lame(E, nu)
        if flips == "recover" and signed_volume(corners) < 0:
            forces[tet] += recovering_forces(mesh.vertices[tet], corners, lame_lambda + 2 * lame_mu)
            continue
        stress = stress_of(deformation(mesh.vertices[tet], corners), strain, lame_lambda, lame_mu)
        areas = area_vectors(corners)
        if flips == "tolerant" and signed_volume(corners) < 0:
            areas = -areas  # outward again
        for vertex, area in zip(tet, areas, strict=True):
            forces[vertex] += stress @ area / 3
    return forces


def edge_damping_forces(mesh, damping, positions, velocities):
    """Eq. 3.9: n (b (dv . n)) on one end, the opposite on the other, b the mean over the tets on the edge."""
    around = {}
    for tet, b in zip(mesh.tets, np.broadcast_to(damping, len(mesh.tets)), strict=True):
        for pair in combinations(sorted(int(v) for v in tet), 2):
            around.setdefault(pair, []).append(b)
    forces = np.zeros_like(positions)
    for (p, q), values in around.items():
        n = (positions[q] - positions[p]) / np.linalg.norm(positions[q] - positions[p])
        force = n * (np.mean(values) * np.dot(velocities[q] - velocities[p], n))
        forces[p] += force
        forces[q] -= force
    return forces


def mean_damping_forces(mesh, damping, velocities):
    """Section 6.4: b (mean velocity of the tetrahedron - own velocity)."""
    forces = np.zeros_like(velocities)
    for tet, b in zip(mesh.tets, np.broadcast_to(damping, len(mesh.tets)), strict=True):
        forces[tet] += b * (velocities[tet].mean(axis=0) - velocities[tet])
    return forces


def rotation(rng):
    """Return a uniformly distributed random rotation."""
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0 else -Q


def stretched_rotation(rng, low, high):
    """F = U R with principal stretches between `low` and `high`."""
    axes = rotation(rng)
    return axes @ np.diag(rng.uniform(low, high, 3)) @ axes.T @ rotation(rng)


def shaken(mesh, rng, amount):
    """The mesh's vertices with noise of `amount` mean edge lengths: at 0.5 about a third of the tets flip."""
    return mesh.vertices + rng.normal(size=mesh.vertices.shape) * amount * mesh.edge_lengths.mean()


def uneven_material(mesh, rng, damping=0.0):
    """A material with different constants in every tetrahedron."""
    count = len(mesh.tets)
    return Material(
        rng.uniform(1e5, 1e6, count),
        rng.uniform(-0.6, 0.45, count),
        rng.uniform(500, 2000, count),
        damping * rng.uniform(0.5, 2, count),
    )
