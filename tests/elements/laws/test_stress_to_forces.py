"""Vertex forces from deformations, compared with closed forms and with the equations in NumPy."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from taichi_soft import Material, box, cylinder, internal_forces

pytestmark = pytest.mark.kernel

MESHES = oracle.MESHES
UPRIGHT = pytest.mark.parametrize("strain", oracle.STRAINS)
EACH_MODE = pytest.mark.parametrize(("law", "strain", "flips"), oracle.params_of(oracle.MODES))
seeds = st.integers(0, 2**32 - 1)


@EACH_MODE
@settings(max_examples=8)
@given(seed=seeds, name=st.sampled_from(list(MESHES)), amount=st.sampled_from([0.01, 0.2, 0.6, 3.0]))
def test_forces_equal_those_of_the_equations_in_numpy(law, strain, flips, seed, name, amount):
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    material = oracle.uneven_material(mesh, rng)
    x = oracle.shaken(mesh, rng, amount) @ oracle.rotation(rng)
    forces = internal_forces(mesh, material, x, law=law, strain=strain, flips=flips)
    expected = oracle.elastic_forces(mesh, material.young, material.poisson, x, strain, flips)
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@UPRIGHT
def test_eq_6_16_as_printed_is_the_law_with_twice_youngs_modulus(strain):
    """sigma = 1/(2V) sum q f^T solved for f (eq. 6.18); the material answers with -f."""
    mesh, E, nu = oracle.ONE_TET, 1e6, 0.3
    x = mesh.vertices @ (np.eye(3) + 0.2 * np.random.default_rng(7).normal(size=(3, 3))).T
    q = (x[1:] - x[0]).T
    F = q @ np.linalg.inv((mesh.vertices[1:] - mesh.vertices[0]).T)
    assert np.linalg.det(F) > 0
    if strain == "linear":
        eps = (F @ F.T - np.eye(3)) / 2
    else:
        squares, axes = np.linalg.eigh(F @ F.T)
        eps = axes * np.sqrt(squares) @ axes.T - np.eye(3)
    sigma = E / (1 + nu) * (eps + nu / (1 - 2 * nu) * np.trace(eps) * np.eye(3))
    f = np.linalg.solve(q / (2 * np.linalg.det(q) / 6), sigma)  # rows f1, f2, f3
    found = internal_forces(mesh, Material(2 * E, nu, 1000.0), x, law="virial", strain=strain)
    np.testing.assert_allclose(found[1:], -f, atol=1e-9 * np.abs(f).max())
    np.testing.assert_allclose(found[0], f.sum(axis=0), atol=1e-9 * np.abs(f).max())


@pytest.mark.parametrize("flips", oracle.FLIPS)
@pytest.mark.parametrize("strain", oracle.EACH_STRAIN)
@settings(max_examples=15)
@given(seed=seeds, name=st.sampled_from(list(MESHES)), amount=st.floats(0, 5))
@example(seed=0, name="torus", amount=0.6)
def test_virial_theorem_and_faces_give_the_same_forces_to_round_off(strain, flips, seed, name, amount):
    """Thesis methods I and II, flipped tetrahedra included."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    material = oracle.uneven_material(mesh, rng)
    x = oracle.shaken(mesh, rng, amount)
    virial, face = (
        internal_forces(mesh, material, x, law=law, strain=strain, flips=flips) for law in oracle.LAWS
    )
    # At rest both are the round-off of forces E x area, so that scale is in the bound.
    scale = np.abs(virial).max() + 1e6 * mesh.edge_lengths.max() ** 2 * 1e-3
    np.testing.assert_allclose(virial, face, rtol=0, atol=1e-12 * scale)


def test_the_noise_of_these_tests_does_flip_tetrahedra():
    x = oracle.shaken(MESHES["torus"], np.random.default_rng(0), 0.6)
    flipped = sum(oracle.signed_volume(x[tet]) < 0 for tet in MESHES["torus"].tets)
    assert 0.2 < flipped / len(MESHES["torus"].tets) < 0.6


@UPRIGHT
@settings(max_examples=25)
@given(seed=seeds, name=st.sampled_from(list(MESHES)), nu=st.floats(-0.9, 0.49))
def test_uniform_deformation_gives_the_stress_of_hookes_law_everywhere(strain, seed, name, nu):
    """Every vertex is pulled by sigma times a third of the outward areas of the faces it does not touch."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    F = oracle.stretched_rotation(rng, 0.3, 2.0)
    x = mesh.vertices @ F.T + rng.normal(size=3)
    sigma = oracle.hooke(oracle.strain_by_root(F, strain), *oracle.lame(2e5, nu))
    expected = np.zeros_like(x)
    for tet in mesh.tets:
        expected[tet] += oracle.area_vectors(x[tet]) @ sigma / 3
    forces = internal_forces(mesh, Material(2e5, nu, 1000.0), x, strain=strain)
    scale = np.abs(sigma).max() * mesh.edge_lengths.max() ** 2
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-11 * scale)

    np.testing.assert_allclose(forces.sum(axis=0), 0, atol=1e-11 * scale * len(x))
    np.testing.assert_allclose(np.cross(x, forces).sum(axis=0), 0, atol=1e-10 * scale * len(x))


@UPRIGHT
@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(["box", "sphere", "torus"]))
def test_uniform_deformation_leaves_the_interior_in_balance(strain, seed, name):
    """Constant stress has no divergence: all forces lie on the surface, where they carry the traction."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    F = oracle.stretched_rotation(rng, 0.4, 2.0)
    x = mesh.vertices @ F.T
    forces = internal_forces(mesh, Material(1e5, 0.3, 1000.0), x, strain=strain)
    inside = np.setdiff1d(np.arange(len(x)), mesh.surface_vertices)
    assert len(inside) > 0
    np.testing.assert_allclose(forces[inside], 0, atol=1e-11 * np.abs(forces).max())

    sigma = oracle.hooke(oracle.strain_by_root(F, strain), *oracle.lame(1e5, 0.3))
    traction = np.zeros_like(x)
    for a, b, c in mesh.surface:
        traction[[a, b, c]] -= sigma @ np.cross(x[b] - x[a], x[c] - x[a]) / 6
    np.testing.assert_allclose(forces, traction, atol=1e-11 * np.abs(forces).max())


@EACH_MODE
@settings(max_examples=4)
@given(seed=seeds, amount=st.sampled_from([0.1, 0.8]))
def test_internal_forces_carry_no_momentum_and_no_angular_momentum(law, strain, flips, seed, amount):
    """Whatever the deformation: they sum to zero, and so do their moments (the stress is symmetric)."""
    rng = np.random.default_rng(seed)
    mesh = MESHES["sphere"]
    x = oracle.shaken(mesh, rng, amount)
    forces = internal_forces(mesh, oracle.uneven_material(mesh, rng), x, law=law, strain=strain, flips=flips)
    scale = np.abs(forces).sum()
    assert np.abs(forces.sum(axis=0)).max() < 1e-13 * scale
    assert np.abs(np.cross(x, forces).sum(axis=0)).max() < 1e-13 * scale * np.abs(x).max()


@pytest.mark.parametrize("shape", ["box", "cylinder"])
@pytest.mark.parametrize("s", [-0.3, -0.01, 0.01, 0.1, 0.5, 1.0])
@pytest.mark.parametrize(("strain", "slope"), [("linear", 0.5), ("exact", 0.0)])
def test_a_bar_without_lateral_contraction_pulls_with_one_plus_half_the_stretch(shape, s, strain, slope):
    """Thesis fig. 6.4 at nu = 0: F / (E A s) = 1 + s/2 with the linear strain, and 1 with the exact one."""
    mesh = box((0.5, 0.4, 2.0), (2, 2, 8)) if shape == "box" else cylinder(0.25, 2.0, 2, 10)
    cap = mesh.vertices[:, 2] > 1 - 1e-9
    corners = mesh.vertices[mesh.surface[cap[mesh.surface].all(axis=1)]]
    area = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2
    )
    assert area == pytest.approx(0.2 if shape == "box" else 6 * 0.25**2 * np.sin(np.pi / 6), rel=1e-9)
    forces = internal_forces(
        mesh, Material(1e6, 0.0, 1000.0), mesh.vertices * (1, 1, 1 + s), law="face", strain=strain
    )
    pull = forces[cap].sum(axis=0)
    np.testing.assert_allclose(pull / (1e6 * area * s), [0, 0, -(1 + slope * s)], atol=1e-11)


@UPRIGHT
def test_poissons_ratio_is_the_contraction_that_leaves_the_sides_free(strain):
    """A bar that is longer by s and thinner by nu s for small s: no force on its sides."""
    nu, s = 0.3, 1e-6
    mesh = box((0.5, 0.5, 2.0), (2, 2, 8))
    x = mesh.vertices * (1 - nu * s, 1 - nu * s, 1 + s)
    forces = internal_forces(mesh, Material(1e6, nu, 1000.0), x, strain=strain)
    middle = np.abs(mesh.vertices[:, 2]) < 0.9
    assert np.abs(forces[middle]).max() < 1e-5 * np.abs(forces).max()
    assert -forces[mesh.vertices[:, 2] > 0.99, 2].sum() == pytest.approx(1e6 * 0.25 * s, rel=1e-5)


@UPRIGHT
@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3])
def test_small_shear_is_resisted_by_the_shear_modulus(strain, nu):
    """The top of a block that is sheared by s is drawn back with G A s."""
    s = 1e-6
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2))
    x = mesh.vertices + s * mesh.vertices[:, [2]] * [1, 0, 0]
    forces = internal_forces(mesh, Material(1e6, nu, 1000.0), x, strain=strain)
    inner = (mesh.vertices[:, 2] > 0.49) & (np.abs(mesh.vertices[:, 0]) < 0.49)
    # Of the top face: the part borne by those of its vertices on which no other traction acts.
    top = mesh.surface[(mesh.vertices[mesh.surface, 2] > 0.49).all(axis=1)]
    share = inner[top].sum() / top.size
    assert -forces[inner, 0].sum() == pytest.approx(1e6 / 2 / (1 + nu) * share * s, rel=1e-4)


@UPRIGHT
def test_forces_grow_with_the_square_of_the_size(strain):
    """Thesis section 6.6: force goes with s^2, mass with s^3, so doubling halves accelerations."""
    mesh = MESHES["sphere"]
    x = oracle.shaken(mesh, np.random.default_rng(3), 0.1)
    material = Material(1e5, 0.3, 1000.0)
    small = internal_forces(mesh, material, x, strain=strain)
    large = internal_forces(mesh.scaled(2.0), material, 2 * x, strain=strain)
    np.testing.assert_allclose(large, 4 * small, atol=1e-12 * np.abs(large).max())


@UPRIGHT
def test_forces_are_proportional_to_youngs_modulus_and_blind_to_density(strain):
    mesh = MESHES["torus"]
    x = oracle.shaken(mesh, np.random.default_rng(3), 0.2)
    one = internal_forces(mesh, Material(1e5, 0.3, 1000.0), x, strain=strain)
    other = internal_forces(mesh, Material(7e5, 0.3, 10.0), x, strain=strain)
    np.testing.assert_allclose(other, 7 * one, atol=1e-12 * np.abs(other).max())
