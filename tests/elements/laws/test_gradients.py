"""Gradients of forces, compared with differences of the forces, and as conjugate gradients use them."""

from itertools import permutations

import bond_meshes
import bond_oracle as bonds
import numpy as np
import pytest
from force_oracle import MESHES, ONE_TET, rotation, signed_volume
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import (
    LAWS,
    Material,
    MeshError,
    OptionError,
    ParticleMesh,
    SpringMaterial,
    force_gradient,
    internal_forces,
    sphere,
)

pytestmark = pytest.mark.kernel

MODES = [
    (law.name, strain.value if strain else None, flips.value)
    for law in LAWS.values()
    if law.flips and law.name != "face"  # its forces and gradients are those of "virial"
    for strain in (law.strains or (None,))
    for flips in law.flips
]
SOLID = [
    pytest.param(
        law,
        strain,
        flips,
        id="-".join(filter(None, (law, strain, flips))),
        marks=pytest.mark.soak if law == "virial" and (strain == "exact" or flips == "off") else (),
    )
    for law, strain, flips in MODES
]
PAIRWISE = ["springs", "volume_springs"]
FROZEN = ["cmpm", "tilted_plane", "tilted_plane_printed"]
COMPARED = ["cmpm2", "best_fitting_plane", "split_ring_plane"]
MATERIAL = Material(1e6, 0.3, 1000.0)
BALL = sphere(0.7, 1)


def differences(mesh, material, x, h, **options):
    """df/dx by central differences of fourth order, (n, 3, n, 3)."""
    found = np.zeros((*x.shape, *x.shape))
    for i in np.ndindex(x.shape):
        for step, weight in ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12)):
            moved = x.copy()
            moved[i] += step * h
            found[(..., *i)] += weight / h * internal_forces(mesh, material, moved, **options)
    return found


def deformed(mesh, rng, amount):
    bend = np.eye(3) + amount * rng.normal(size=(3, 3))
    return mesh.vertices @ bend.T + 0.1 * amount * rng.normal(size=mesh.vertices.shape)


@pytest.mark.parametrize("mirrored", [False, True], ids=["upright", "mirrored"])
@pytest.mark.parametrize(("law", "strain", "flips"), SOLID)
@settings(max_examples=2)
@given(seed=st.integers(0, 2**32 - 1))
def test_exact_gradients_of_tetrahedral_laws_equal_differences(law, strain, flips, seed, mirrored):
    """The tetrahedra are upright or inverted, each with its own deformation."""
    mesh = MESHES["tet"]
    rng = np.random.default_rng(seed)
    x = deformed(mesh, rng, 0.2)
    if mirrored:
        x = x * (1, 1, -1)
    options = {"law": law, "strain": strain, "flips": flips}
    exact = force_gradient(mesh, MATERIAL, x, **options)
    expected = differences(mesh, MATERIAL, x, 1e-4, **options)
    np.testing.assert_allclose(exact, expected, atol=2e-6 * np.abs(expected).max())


@pytest.mark.parametrize("mirrored", [False, True], ids=["upright", "mirrored"])
@pytest.mark.parametrize("law", ["virial", "st_venant_kirchhoff", "neo_hookean", *PAIRWISE])
def test_exact_gradients_of_whole_bodies_equal_differences(law, mirrored):
    rng = np.random.default_rng(5)
    count = len(BALL.tets)
    material = Material(rng.uniform(1e5, 1e6, count), rng.uniform(0, 0.4, count), 1000.0)
    x = deformed(BALL, rng, 0.15) * (1, 1, -1 if mirrored else 1)
    exact = force_gradient(BALL, material, x, law=law)
    expected = differences(BALL, material, x, 1e-4, law=law)
    np.testing.assert_allclose(exact, expected, atol=1e-6 * np.abs(expected).max())


def test_gradients_of_given_springs_equal_differences_also_where_pressed():
    mesh = ParticleMesh(
        [[0, 0, 0], [1, 0, 0], [0.2, 0.9, 0.1], [0.3, 0.2, 1]], [[0, 1], [1, 2], [2, 3], [0, 3]], 1.0
    )
    material = SpringMaterial([10.0, 20, 30, 40], rest_length=[2.0, 1, 0.5, 1.5])
    exact = force_gradient(mesh, material, mesh.vertices, law="springs")
    expected = differences(mesh, material, mesh.vertices, 1e-3, law="springs")
    np.testing.assert_allclose(exact, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["ring", "ball"])
@pytest.mark.parametrize("law", [*FROZEN, *COMPARED])
def test_gradients_with_normals_held_equal_differences_of_eq_4_4(law, name):
    """On every edge, by differences of the oracle's forces with its normal held.

    Laws that compare directions take for an edge what "cmpm" would have with the same normal: the tensile and
    shear stiffness a E / r and a G / r along and across it.
    """
    mesh, faces = bond_meshes.MESHES[name], bond_meshes.FACES[name]
    x = deformed(mesh, np.random.default_rng(1), 0.2)
    E, G = np.full(len(mesh.tets), 1e6), np.full(len(mesh.tets), 1e6 / 2.6)
    expected = np.zeros((*x.shape, *x.shape))
    for p, q in mesh.edges.tolist():
        frame = bonds.frame(law, mesh, p, q, x, faces[p, q])
        if frame is None:
            continue
        r, n, length, area = frame
        if law in COMPARED:
            r = x[q] - x[p]
            length = np.linalg.norm(r)
        tensile, shear = area * E[0], area * G[0]
        block, h = np.zeros((3, 3)), 1e-4 * length
        for axis, unit in enumerate(np.eye(3)):
            ahead, behind = (
                bonds.double_spring(r + s * h * unit, n, length, tensile, shear) for s in (1, -1)
            )
            block[:, axis] = (ahead - behind) / (2 * h)
        for i, j, sign in ((p, p, -1), (q, q, -1), (p, q, 1), (q, p, 1)):
            expected[i, :, j] += sign * block
    exact = force_gradient(mesh, MATERIAL, x, law=law)
    np.testing.assert_allclose(exact, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["ring", "ball"])
@pytest.mark.parametrize("law", [*FROZEN, *COMPARED])
def test_gradients_with_normals_held_are_a_tenth_to_six_tenths_off_the_true_ones(law, name):
    """The difference is measured by sums of squares.

    The gradients ignore the rotation of the planes (thesis 4.2).
    """
    mesh = bond_meshes.MESHES[name]
    gaps = []
    for amount in (0.0, 0.1):
        x = deformed(mesh, np.random.default_rng(1), amount)
        true = differences(mesh, MATERIAL, x, 1e-4, law=law)
        gaps.append(np.linalg.norm(force_gradient(mesh, MATERIAL, x, law=law) - true) / np.linalg.norm(true))
    assert min(gaps) > 0.1
    assert max(gaps) < 0.6


POSES = {
    "at rest": lambda x, rng: x,
    "pressed to half": lambda x, rng: x * (1, 1, 0.5),
    "shaken": lambda x, rng: x + 0.1 * rng.normal(size=x.shape),
    "inside out": lambda x, rng: x * (1, 1, -1) + 0.05 * rng.normal(size=x.shape),
    "flat": lambda x, rng: x * (1, 1, 0),
    "scrambled": lambda x, rng: rng.normal(size=x.shape),
    "a point": lambda x, rng: x * 0,
}


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize(
    ("law", "strain", "flips"),
    [*SOLID, *(pytest.param(name, None, None, id=name) for name in [*PAIRWISE, *FROZEN, *COMPARED])],
)
def test_the_projected_system_is_symmetric_and_never_negative(law, strain, flips, pose):
    """So that masses make it positive definite. At rest it is the exact gradient."""
    options = {"law": law, "strain": strain, "flips": flips}
    x = POSES[pose](BALL.vertices, np.random.default_rng(2))
    size = x.size
    K = -force_gradient(BALL, MATERIAL, x, **options, projected=True).reshape(size, size)
    assert np.isfinite(K).all()
    np.testing.assert_allclose(K, K.T, atol=1e-10 * np.abs(K).max())
    values = np.linalg.eigvalsh(K)
    assert values[0] > -1e-9 * values[-1] - 1e-9
    assert values[-1] > 0 or pose == "a point"
    if pose == "at rest" and law != "volume_springs":
        exact = -force_gradient(BALL, MATERIAL, x, **options).reshape(size, size)
        np.testing.assert_allclose(K, exact, atol=1e-6 * np.abs(K).max())


def piola(law_options, material, F):
    """P of ONE_TET deformed by F [Pa], from its forces f_i = -V P g_i, g_i the rows of A^-1."""
    rest = ONE_TET.vertices
    forces = internal_forces(ONE_TET, material, rest @ F.T, **law_options)
    return -forces[1:].T @ (rest[1:] - rest[0]) / signed_volume(rest)


STRETCHES = {
    "shaken": (1.2, 0.9, 0.8),
    "pressed": (1.1, 0.9, 0.3),
    "drawn out": (6.0, 5.5, 1.5),
    "inside out": (1.2, 0.9, -0.7),
    "nearly flat": (1.2, 0.7, -0.02),
}


@pytest.mark.parametrize("poisson", [0.3, -0.3])
@pytest.mark.parametrize("stretches", STRETCHES.values(), ids=STRETCHES)
@pytest.mark.parametrize(("law", "strain", "flips"), SOLID)
def test_the_projected_system_is_the_positive_part_of_dp_by_df(law, strain, flips, stretches, poisson):
    """The reference is the symmetric part of differences of the stress.

    The stiffness against rotation is at most 10 (2 mu + |lambda|).
    """
    options = {"law": law, "strain": strain, "flips": flips}
    material = Material(1e6, poisson, 1000.0)
    rng = np.random.default_rng(4)
    U, V = rotation(rng), rotation(rng)
    F, h = U * stretches @ V.T, 1e-4
    H = np.zeros((9, 9))
    for k, unit in enumerate(np.eye(9).reshape(9, 3, 3)):
        for step, weight in ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12)):
            H[:, k] += weight / h * piola(options, material, F + step * h * unit).ravel()
    H = (H + H.T) / 2
    for a, b in ((0, 1), (0, 2), (1, 2)):
        turn = (np.outer(U[:, a], V[:, b]) - np.outer(U[:, b], V[:, a])).ravel() / np.sqrt(2)
        largest = 10 * (2 * material.lame_mu + abs(material.lame_lambda))
        H -= max(turn @ H @ turn - largest, 0) * np.outer(turn, turn)
    values, axes = np.linalg.eigh(H)
    H = (axes * np.maximum(values, 0)) @ axes.T
    inverse = np.linalg.inv((ONE_TET.vertices[1:] - ONE_TET.vertices[0]).T)
    g = np.vstack([-inverse.sum(axis=0), inverse])
    expected = -signed_volume(ONE_TET.vertices) * np.einsum("ia,jb,kalb->ikjl", g, g, H.reshape((3,) * 4))
    found = force_gradient(ONE_TET, material, ONE_TET.vertices @ F.T, **options, projected=True)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("pose", ["pressed to half", "shaken", "inside out"])
@pytest.mark.parametrize("law", PAIRWISE)
def test_the_projected_system_of_springs_is_that_of_each_and_the_positive_part_of_each_volume(law, pose):
    """Compare the positive part of the gradient with NumPy.

    A compressed spring contributes nothing by rotation. A volume pulls its corners with w per relative
    growth, and g is the growth per displacement. The gradient uses the positive part of the symmetric part of
    w g^T.
    """
    rng = np.random.default_rng(6)
    count = len(BALL.tets)
    E, nu = rng.uniform(1e5, 1e6, count), rng.uniform(0.1, 0.4, count)
    x = POSES[pose](BALL.vertices, rng)
    expected = np.zeros((*x.shape, *x.shape))
    for p, q in BALL.edges.tolist():
        r = x[q] - x[p]
        n, length = bonds.unit(r), np.linalg.norm(r)
        pull = getattr(bonds, law.removesuffix("s"))(BALL, p, q, x, E, nu) @ n
        along = bonds.mean_over(BALL, p, q, E) * bonds.edge_area(BALL, p, q) / bonds.rest_length(BALL, p, q)
        across = max(pull / length, 0.0)
        block = along * np.outer(n, n) + across * (np.eye(3) - np.outer(n, n))
        for i, j, sign in ((p, p, 1), (q, q, 1), (p, q, -1), (q, p, -1)):
            expected[i, :, j] += sign * block
    for t, tet in enumerate(BALL.tets) if law == "volume_springs" else ():
        corners, before = x[tet], signed_volume(BALL.vertices[tet])
        w, g = np.zeros((4, 3)), np.zeros((4, 3))
        for i, j in permutations(range(4), 2):
            area = bonds.edge_area(BALL, int(tet[i]), int(tet[j]))
            w[i] -= E[t] * nu[t] * area * bonds.unit(corners[j] - corners[i])
        for k in np.ndindex(4, 3):  # the volume is linear in each coordinate
            moved = corners.copy()
            moved[k] += 1e-3
            g[k] = (abs(signed_volume(moved)) - abs(signed_volume(corners))) / (1e-3 * before)
        part = np.outer(w, g)
        values, axes = np.linalg.eigh((part + part.T) / 2)
        part = (axes * np.maximum(values, 0)) @ axes.T
        expected[np.ix_(tet, range(3), tet, range(3))] += part.reshape(4, 3, 4, 3)
    found = -force_gradient(BALL, Material(E, nu, 1000.0), x, law=law, projected=True)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_the_stiffness_of_the_thesis_is_not_symmetric_away_from_rest():
    """The asymmetry is 7 % at half the height for nu = 0.3.

    Conjugate gradients therefore use a symmetrised copy.
    """
    x = MESHES["tet"].vertices * (1, 1, 0.5)
    K = force_gradient(MESHES["tet"], MATERIAL, x).reshape(12, 12)
    gap = np.linalg.norm(K - K.T) / np.linalg.norm(K + K.T)
    assert gap == pytest.approx(0.07, abs=0.005)
    energy = force_gradient(MESHES["tet"], MATERIAL, x, law="neo_hookean").reshape(12, 12)
    np.testing.assert_allclose(energy, energy.T, atol=1e-9 * np.abs(energy).max())


@pytest.mark.parametrize("value", [1, "yes", None])
def test_projected_is_yes_or_no(value):
    with pytest.raises(OptionError, match=r"projected.*True.*False"):
        force_gradient(BALL, MATERIAL, BALL.vertices, projected=value)


def test_what_does_not_fit_is_refused():
    with pytest.raises(MeshError, match="positions has shape"):
        force_gradient(BALL, MATERIAL, BALL.vertices[:-1])
    with pytest.raises(OptionError, match="unknown law"):
        force_gradient(BALL, MATERIAL, BALL.vertices, law="hope")
