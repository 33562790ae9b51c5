"""The automatic step is never above the limit of linear stability at rest, and at most 15 % below it.

The oracle: stiffness and damping assembled here from shape functions of linear tetrahedra and from the edges,
and ARPACK's largest eigenvalue of h^2 K + 2 h C, which is 4 at the limit of leapfrog and its lazy variant.
"""

import numpy as np
import pytest
from random_meshes import scattered
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import eigsh
from step_oracle import differences

from taichi_soft import Material, beam, box, cylinder, delaunay_mesh, sphere, stable_step, torus
from taichi_soft.bodies.description import BodyDescription
from taichi_soft.elements.laws import element_model, fit_model

MESHES = {
    "box": box((1.0, 0.6, 0.8), (2, 1, 2)),
    "sphere": sphere(0.5, 3),
    "speck": sphere(0.005, 2),
    "beam": beam(2.0, 0.2, 0.2, 2),
    "torus": torus(1.0, 0.4, 1, 8),
    "cylinder": cylinder(0.5, 2.0, 2, 4),
    "plate": box((1.0, 1.0, 0.02), (8, 8, 1)),
    "scattered": scattered(150, 1, flattest=2e-6),
    "scattered more": scattered(600, 2, flattest=2e-6),
    "scattered in a plate": scattered(300, 3, (1.0, 0.5, 0.1), flattest=2e-6),
    "scattered in a rod": scattered(200, 4, (0.05, 0.05, 1.0), flattest=2e-6),
}
MODELS = ("edge", "tet_mean")
CASES = [  # nu; damping over l^2 sqrt(E rho), l being the mean edge; model
    *((nu, 0.0, "edge") for nu in (-0.3, 0.3, 0.49)),
    *(
        (nu, part, model)
        for nu in (0.0, 0.45)
        for part in (1e-4, 0.05, 20.0)
        for model in ("edge", "tet_mean")
    ),
]
YOUNG, DENSITY = 1e5, 1000.0


def assembled(mesh, young, poisson, density, b, model):
    """Return K and C of the body, divided by the masses, as sparse matrices."""
    lame, mu = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 * (1 + poisson))
    elasticity = np.zeros((6, 6))
    elasticity[:3, :3] = lame
    elasticity[range(6), range(6)] += np.array([2, 2, 2, 1, 1, 1]) * mu
    x = mesh.vertices[mesh.tets]
    gradients = np.linalg.inv(np.concatenate([np.ones((len(x), 4, 1)), x], axis=2))[:, 1:].swapaxes(1, 2)
    volumes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    strain = np.zeros((len(x), 6, 12))
    for corner in range(4):
        a, c, d = gradients[:, corner].T
        zero = np.zeros_like(a)
        rows = [[a, zero, zero], [zero, c, zero], [zero, zero, d], [zero, d, c], [d, zero, a], [c, a, zero]]
        strain[:, :, 3 * corner : 3 * corner + 3] = np.moveaxis(np.array(rows), 2, 0)
    K = volumes[:, None, None] * strain.swapaxes(1, 2) @ elasticity @ strain
    mass = np.bincount(mesh.tets.ravel(), np.repeat(volumes * density / 4, 4), len(mesh.vertices))
    if model == "tet_mean":
        braking = b * np.kron(np.eye(4) - 0.25, np.eye(3))
        owners, C = mesh.tets, np.broadcast_to(braking, K.shape)
    else:
        ends = mesh.vertices[mesh.edges]
        n = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
        along = b * n[:, :, None] * n[:, None]
        owners, C = mesh.edges, np.block([[along, -along], [-along, along]])
    scale = diags(np.repeat(mass**-0.5, 3))
    return (
        scale @ summed(rows, blocks, 3 * len(mass)) @ scale for rows, blocks in ((mesh.tets, K), (owners, C))
    )


def summed(owners, blocks, count):
    places = (3 * owners[:, :, None] + np.arange(3)).reshape(len(owners), -1)
    rows, columns = (np.broadcast_to(p, blocks.shape) for p in (places[:, :, None], places[:, None]))
    return coo_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), (count, count)).tocsr()


def largest(matrix):
    if matrix.shape[0] < 400:
        return np.linalg.eigvalsh(matrix.toarray())[-1]
    return eigsh(matrix, k=1, which="LA", tol=1e-7, ncv=60, return_eigenvectors=False)[0]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.soak if name == "cylinder" else ()) for name in MESHES]
)
def test_the_step_is_below_the_limit_of_arpack_and_not_far_below(name):
    mesh = MESHES[name]
    for poisson, part, model in CASES:
        b = part * float(mesh.edge_lengths.mean()) ** 2 * np.sqrt(YOUNG * DENSITY)
        K, C = assembled(mesh, YOUNG, poisson, DENSITY, b, model)
        material = Material(YOUNG, poisson, DENSITY, b)
        h = stable_step(mesh, material, element_model("virial", damping_model=model)).limit
        assert largest(h * h * K + 2 * h * C) <= 4.0
        h /= 0.85
        assert largest(h * h * K + 2 * h * C) >= 4.0


@pytest.mark.parametrize("law", ["springs", "volume_springs", pytest.param("cmpm", marks=pytest.mark.soak)])
def test_the_step_of_laws_along_edges_is_below_the_limit_too(law):
    """K by differences of the forces; dampers along the edges and, in the laws of chapter 4, across them."""
    mesh = delaunay_mesh(sphere(0.5, 2))
    ends = mesh.vertices[mesh.edges]
    n = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    braking = np.eye(3) if law == "cmpm" else n[:, :, None] * n[:, None]
    K, _ = differences(mesh, Material(YOUNG, 0.3, DENSITY), law=law)
    for b in (0.0, 30.0, 1000.0):
        material, model = Material(YOUNG, 0.3, DENSITY, b), element_model(law)
        body = BodyDescription(mesh, material, fit_model(model, mesh, material))
        scale = np.repeat(body.masses**-0.5, 3)
        matrices = braking * body.bonds.is_bond[:, None, None]
        C = summed(mesh.edges, np.block([[matrices, -matrices], [-matrices, matrices]]), len(scale)).toarray()
        step = stable_step(mesh, material, model).limit
        for h, is_stable in ((step, True), (step / 0.85, False)):
            form = (h * h * K + 2 * h * b * C) * np.outer(scale, scale)
            assert (np.abs(np.linalg.eigvals(form)).max() <= 4.0) == is_stable
