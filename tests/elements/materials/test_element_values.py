"""Material constants: relations between them, refused values, and messages for the user."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_soft import PRESETS, Material, OptionError, box, internal_forces, preset
from taichi_soft.core.errors import MaterialError, TaichiSoftError

pytestmark = pytest.mark.numpy

CUBE = box((1, 1, 1), (1, 1, 1))
GOOD = {"young": 1e6, "poisson": 0.3, "density": 1000.0, "damping": 10.0}
ratios = st.floats(-0.99, 0.499, allow_subnormal=False)
moduli = st.floats(1e-3, 1e12)


@given(young=moduli, nu=ratios)
def test_lame_constants_give_back_young_and_poisson(young, nu):
    """E = mu (3 lambda + 2 mu) / (lambda + mu), nu = lambda / (2 (lambda + mu))."""
    material = Material(young, nu, 1.0)
    lam, mu = material.lame_lambda, material.lame_mu
    assert mu * (3 * lam + 2 * mu) / (lam + mu) == pytest.approx(young, rel=1e-9)
    assert lam / (2 * (lam + mu)) == pytest.approx(nu, abs=1e-9)


@given(young=moduli, nu=ratios)
def test_every_material_that_is_accepted_resists_shear_and_compression(young, nu):
    material = Material(young, nu, 1.0)
    assert material.lame_mu > 0
    assert material.lame_lambda + 2 / 3 * material.lame_mu == pytest.approx(
        young / (3 * (1 - 2 * nu)), rel=1e-9
    )


@given(young=moduli, nu=ratios, stress=st.floats(-1e6, 1e6, allow_subnormal=False))
def test_uniaxial_stress_strains_by_one_over_young_and_contracts_by_poisson(young, nu, stress):
    """The strain (s, -nu s, -nu s) with s = stress / E leaves no stress on the sides."""
    material = Material(young, nu, 1.0)
    s = stress / young
    strain = np.array([s, -nu * s, -nu * s])
    found = material.lame_lambda * strain.sum() + 2 * material.lame_mu * strain
    np.testing.assert_allclose(
        found, [stress, 0, 0], atol=1e-9 * abs(stress) / (1 - 2 * nu) / (1 + nu) + 1e-250
    )


def test_steel_as_in_the_tables():
    """E = 210 GPa, nu = 0.3: G = 80.8 GPa, K = 175 GPa."""
    steel = Material(young=210e9, poisson=0.3, density=7850.0)
    assert steel.lame_mu == pytest.approx(80.769e9, rel=1e-4)
    assert steel.lame_lambda + 2 / 3 * steel.lame_mu == pytest.approx(175e9)
    assert steel.damping == 0.0


@pytest.mark.parametrize("nu", [-0.4, 0.0, 0.3])
def test_the_stiffness_matrix_inverts_the_compliance_of_a_bar_and_of_a_sheared_block(nu):
    """Strains 1 / E along and -nu / E across for unit pulls, 2 (1 + nu) / E for a unit shear."""
    young = np.array([1e5, 3e6])
    for E, matrix in zip(young, Material(young, nu, 1.0).stiffness_matrices(2), strict=True):
        compliance = np.diag([1 + nu] * 3 + [2 * (1 + nu)] * 3) / E
        compliance[:3, :3] -= nu / E
        np.testing.assert_allclose(matrix @ compliance, np.eye(6), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("young", 0.0, "young is 0: it must be above 0 Pa"),
        ("young", -1.0, "young is -1: it must be above 0 Pa"),
        ("poisson", 0.5, "poisson is 0.5: it must be above -1 and below 0.5"),
        ("poisson", 0.7, "poisson is 0.7"),
        ("poisson", -1.0, "poisson is -1: it must be above -1"),
        ("density", 0.0, "density is 0: it must be above 0 kg/m"),
        ("density", -3.0, "density is -3"),
        ("damping", -0.1, "damping is -0.1: it must be 0 N s/m or more"),
    ],
)
def test_constants_out_of_range_are_named_with_value_and_range(name, value, text):
    with pytest.raises(MaterialError) as caught:
        Material(**{**GOOD, name: value})
    assert text in str(caught.value)


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_constants_that_are_not_finite_are_refused(name, value):
    with pytest.raises(MaterialError, match=name):
        Material(**{**GOOD, name: value})


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize("value", ["soft", None, [], [[1.0]], [1.0, [2.0]], object(), 1j, {}])
def test_what_is_no_number_is_refused(name, value):
    with pytest.raises(MaterialError, match=name):
        Material(**{**GOOD, name: value})


@pytest.mark.parametrize("name", GOOD)
def test_the_first_bad_tetrahedron_is_named(name):
    values = np.full(10, 0.2)
    values[[3, 7]] = np.nan
    with pytest.raises(MaterialError, match=f"{name} of tetrahedron 3 is nan"):
        Material(**{**GOOD, name: values})


def test_errors_are_value_errors_of_this_package():
    assert issubclass(MaterialError, ValueError)
    assert issubclass(MaterialError, TaichiSoftError)


@pytest.mark.parametrize("name", GOOD)
def test_arrays_for_another_number_of_tetrahedra_are_refused(name):
    mesh = box(cells=(1, 1, 1))
    material = Material(**{**GOOD, name: np.full(7, 0.2)})
    with pytest.raises(MaterialError, match=f"7 values.*{len(mesh.tets)} tetrahedra"):
        material.per_tet(name, len(mesh.tets))
    if name != "density":  # forces do not depend on the density
        with pytest.raises(MaterialError, match="7 values"):
            internal_forces(mesh, material, mesh.vertices)


def test_one_number_holds_for_every_tetrahedron():
    material = Material(**GOOD)
    for name, value in GOOD.items():
        rows = material.per_tet(name, 5)
        assert rows.dtype == np.float64
        assert rows.tolist() == [value] * 5


def test_arrays_are_copied_and_cannot_be_changed_behind_the_materials_back():
    young = np.array([1.0, 2.0])
    material = Material(young, 0.2, 1000.0)
    young[0] = -1
    assert material.young.tolist() == [1.0, 2.0]
    with pytest.raises(ValueError, match="read-only"):
        material.young[0] = -1
    with pytest.raises(AttributeError):
        material.young = 3.0


def test_constants_by_tetrahedron_mix_with_numbers():
    material = Material([1e5, 2e5], 0.25, 1000.0)
    np.testing.assert_allclose(material.lame_lambda, [0.4e5, 0.8e5])
    np.testing.assert_allclose(material.per_tet("lame_mu", 2), [0.4e5, 0.8e5])


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_materials_by_name(name):
    material = preset(name)
    assert isinstance(material, Material)
    assert 1e3 <= material.young <= 1e8
    assert 10 <= material.density <= 3000


def test_the_thesis_sphere_is_made_of_what_section_6_6_says():
    material = preset("thesis_sphere")
    assert (material.young, material.poisson, material.density, material.damping) == (1e6, 0.1, 1000, 100)


def test_rubber_keeps_its_volume_cork_its_width_and_auxetic_foam_grows_wider():
    assert preset("soft_rubber").poisson > 0.45
    assert preset("cork").poisson == 0
    assert preset("auxetic_foam").poisson < 0


@pytest.mark.parametrize("name", ["", "Cork", "granite", None, [], 3])
def test_unknown_presets_are_refused_with_the_list(name):
    with pytest.raises(OptionError, match=r"material .*'cork'"):
        preset(name)


@pytest.mark.parametrize("value", [None, 1e6, "cork", GOOD])
def test_what_is_no_material_is_refused(value):
    with pytest.raises(MaterialError, match=r"taichi_soft\.Material, got"):
        internal_forces(CUBE, value, CUBE.vertices)


@pytest.mark.parametrize(
    "constants",
    [
        (True, 0.3, 1000),
        ("1e6", 0.3, 1000),
        (1e6 + 1j, 0.3, 1000),
        (1e308, 0.3, 1000),
        (1e19, 0.4999999, 1000),
        (1e6, 0.3, 1e39),
        (1e6, 0.3, 1e-300),
        (1e-300, 0.3, 1000),
        (1e15, -0.9999999999, 1000),
        ([1e6, 1e6], [0.1, 0.2, 0.3], 1000),
    ],
)
def test_what_is_no_number_overflows_or_does_not_match_is_refused(constants):
    with pytest.raises(MaterialError):
        Material(*constants)
