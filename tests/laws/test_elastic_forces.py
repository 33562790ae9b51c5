"""Elastic forces against equations written out in NumPy float64 and against closed forms."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import (
    Material,
    MeshError,
    OptionError,
    ParticleMesh,
    TetMesh,
    box,
    internal_forces,
    sphere,
    torus,
)
from tests.laws import oracle

LAWS, STRAINS, FLIPS = ("virial", "face"), ("linear", "exact"), ("tolerant", "recover", "off")
MODES = list(itertools.product(LAWS, STRAINS, FLIPS))
MATERIAL = Material(young=2.0e5, poisson=0.3, density=1000.0, damping=30.0)
UNIT = TetMesh([(0, 0, 0), (1, 0, 0), (0.2, 1, 0), (0.1, 0.3, 1)], [(0, 1, 2, 3)])
BODY = box((1.0, 0.8, 0.6), (2, 2, 2))


def rotation(seed: int) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def scale_of(mesh, material=MATERIAL):
    return float(np.max(material.per_tet("young", len(mesh.tets)))) * np.ptp(mesh.vertices) ** 2


@pytest.mark.parametrize(("law", "strain", "flips"), MODES)
@pytest.mark.parametrize("noise", [0.05, 0.6])
def test_forces_equal_the_equations_in_numpy(law, strain, flips, noise):
    now = BODY.vertices + np.random.default_rng(3).normal(scale=noise, size=BODY.vertices.shape)
    found = internal_forces(BODY, MATERIAL, now, law=law, strain=strain, flips=flips)
    expected = oracle.body_forces(BODY, MATERIAL, now, strain, flips)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(("strain", "flips"), list(itertools.product(STRAINS, FLIPS)))
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), noise=st.floats(0.01, 2.0))
def test_virial_and_face_give_the_same_forces_to_round_off(strain, flips, seed, noise):
    now = UNIT.vertices + np.random.default_rng(seed).normal(scale=noise, size=(4, 3))
    a, b = (internal_forces(UNIT, MATERIAL, now, law=law, strain=strain, flips=flips) for law in LAWS)
    np.testing.assert_allclose(a, b, atol=1e-11 * max(np.abs(a).max(), 1.0))


@pytest.mark.parametrize(("law", "strain", "flips"), MODES)
@pytest.mark.parametrize(
    "mesh", [BODY, sphere(0.7, 2), torus(1.0, 0.3, 2, 16)], ids=["box", "sphere", "torus"]
)
def test_no_force_at_rest_and_after_turning_and_moving(law, strain, flips, mesh):
    for now in (mesh.vertices, mesh.vertices @ rotation(5).T + (3.0, -20.0, 7.0)):
        found = internal_forces(mesh, MATERIAL, now, law=law, strain=strain, flips=flips)
        assert np.abs(found).max() < 1e-11 * scale_of(mesh)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_forces_turn_with_the_body(seed):
    now = BODY.vertices + np.random.default_rng(seed).normal(scale=0.2, size=BODY.vertices.shape)
    R = rotation(seed)
    straight = internal_forces(BODY, MATERIAL, now, strain="exact", flips="recover")
    turned = internal_forces(BODY, MATERIAL, now @ R.T + 1.0, strain="exact", flips="recover")
    np.testing.assert_allclose(turned, straight @ R.T, atol=1e-8 * np.abs(straight).max())


@pytest.mark.parametrize(("law", "strain", "flips"), MODES)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_forces_sum_to_no_force_and_no_torque(law, strain, flips, seed):
    now = BODY.vertices + np.random.default_rng(seed).normal(scale=0.5, size=BODY.vertices.shape)
    found = internal_forces(BODY, MATERIAL, now, law=law, strain=strain, flips=flips)
    size = np.abs(found).max()
    assert np.abs(found.sum(axis=0)).max() < 1e-10 * size * len(found)
    assert np.abs(np.cross(now, found).sum(axis=0)).max() < 1e-10 * size * len(found)


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize(
    "mesh", [BODY, sphere(0.7, 3), torus(1.0, 0.3, 2, 16)], ids=["box", "sphere", "torus"]
)
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_uniform_deformation_gives_hookes_stress(strain, mesh, seed):
    """The virial of the vertex forces is the analytic stress times the volume; inner vertices feel nothing."""
    F = np.eye(3) + np.random.default_rng(seed).uniform(-0.2, 0.2, size=(3, 3))
    now = mesh.vertices @ F.T
    found = internal_forces(mesh, MATERIAL, now, strain=strain)
    w, axes = np.linalg.eigh(F @ F.T)
    values = np.sqrt(w) - 1 if strain == "exact" else (w - 1) / 2
    e = axes @ np.diag(values) @ axes.T
    lam, mu = 2.0e5 * 0.3 / (1.3 * 0.4), 2.0e5 / 2.6
    stress = lam * np.trace(e) * np.eye(3) + 2 * mu * e
    volume = mesh.volume * np.linalg.det(F)
    np.testing.assert_allclose(-(now.T @ found) / volume, stress, atol=1e-9 * np.abs(stress).max())
    inner = np.setdiff1d(np.arange(len(now)), mesh.surface)
    if len(inner):
        assert np.abs(found[inner]).max() < 1e-10 * np.abs(found).max()


@settings(max_examples=20, deadline=None)
@given(stretch=st.floats(-0.5, 1.0), young=st.floats(1e3, 1e8))
def test_a_bar_without_lateral_strain_pulls_with_one_plus_half_the_strain(stretch, young):
    """F / (E A s) = 1 + s/2 for nu = 0 and the linear strain, and 1 for the exact one."""
    bar = box((0.5, 0.4, 2.0), (2, 2, 4))
    now = bar.vertices * (1, 1, 1 + stretch)
    cap = bar.vertices[:, 2] > 1.0 - 1e-9
    material = Material(young, 0.0, 1000.0, 0.0)
    for strain, expected in (("linear", stretch + stretch**2 / 2), ("exact", stretch)):
        force = -internal_forces(bar, material, now, strain=strain)[cap, 2].sum()
        assert force == pytest.approx(young * 0.2 * expected, rel=1e-9, abs=1e-10 * young)


def test_each_tetrahedron_has_the_constants_of_its_own():
    rng = np.random.default_rng(8)
    count = len(BODY.tets)
    mixed = Material(rng.uniform(1e4, 1e6, count), rng.uniform(-0.8, 0.45, count), 1000.0, 0.0)
    now = BODY.vertices + rng.normal(scale=0.1, size=BODY.vertices.shape)
    expected = oracle.body_forces(BODY, mixed, now)
    np.testing.assert_allclose(
        internal_forces(BODY, mixed, now), expected, atol=1e-10 * np.abs(expected).max()
    )


@pytest.mark.parametrize(("law", "strain", "flips"), MODES)
def test_float32_agrees_with_float64_to_its_precision(law, strain, flips):
    now = BODY.vertices + np.random.default_rng(2).normal(scale=0.05, size=BODY.vertices.shape)
    options = {"law": law, "strain": strain, "flips": flips}
    fine = internal_forces(BODY, MATERIAL, now, **options)
    coarse = internal_forces(BODY, MATERIAL, now, dtype=np.float32, **options)
    assert coarse.dtype == np.float32
    np.testing.assert_allclose(coarse, fine, atol=1e-4 * np.abs(fine).max())


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"positions": np.zeros((3, 3))}, MeshError, "shape"),
        ({"positions": np.full((4, 3), np.nan)}, MeshError, "not finite"),
        ({"positions": "here"}, MeshError, "numbers"),
        ({"velocities": np.zeros((4, 2))}, MeshError, "velocities"),
        ({"law": "rubber"}, OptionError, "virial"),
        ({"strain": "log"}, OptionError, "exact"),
        ({"flips": "never"}, OptionError, "recover"),
        ({"damping_model": "air"}, OptionError, "tet_mean"),
        ({"dtype": np.float16}, OptionError, "float64"),
        ({"mesh": ParticleMesh([(0, 0, 0), (1, 0, 0)], [(0, 1)], [1, 1])}, MeshError, "TetMesh"),
    ],
)
def test_bad_input_is_refused_with_the_way_out(options, error, text):
    given_values = {"mesh": UNIT, "material": MATERIAL, "positions": UNIT.vertices, **options}
    with pytest.raises(error, match=text):
        internal_forces(**given_values)
