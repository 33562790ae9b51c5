"""Stiffness matrices: stretched, sheared and rotated cubes reproduce the given constants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_soft.core.errors import MaterialError, OptionError
from taichi_soft.elements.materials import Stiffness

pytestmark = pytest.mark.numpy

WOOD = {"young": (12e9, 0.9e9, 0.5e9), "poisson": (0.4, 0.45, 0.35), "shear": (0.05e9, 0.6e9, 0.7e9)}
AXES = ((1, 2), (0, 2), (0, 1))
seeds = st.integers(0, 2**32 - 1)


def voigt(matrix, factor):
    """Six components of a symmetric matrix, its shear times `factor`."""
    return np.array([*np.diag(matrix), *(factor * matrix[a, b] for a, b in AXES)])


def stress_of(stiffness, strain):
    """Stress (3, 3) of a strain (3, 3), by the matrix."""
    row = stiffness.matrix @ voigt(strain, 2)
    stress = np.diag(row[:3])
    for value, (a, b) in zip(row[3:], AXES, strict=True):
        stress[a, b] = stress[b, a] = value
    return stress


def strain_of(stiffness, stress):
    row = np.linalg.solve(stiffness.matrix, voigt(stress, 1))
    strain = np.diag(row[:3])
    for value, (a, b) in zip(row[3:], AXES, strict=True):
        strain[a, b] = strain[b, a] = value / 2
    return strain


def rotation(rng):
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(R))
    return Q if np.linalg.det(Q) > 0 else -Q


def any_stiffness(rng):
    """A stiffness without any symmetry."""
    root = rng.normal(size=(6, 6))
    return Stiffness(1e6 * (root @ root.T + np.eye(6)))


def symmetric(rng):
    strain = rng.normal(size=(3, 3))
    return strain + strain.T


@given(seed=seeds, young=st.floats(1e3, 1e10), nu=st.floats(-0.9, 0.49, allow_subnormal=False))
def test_isotropic_is_hookes_law(seed, young, nu):
    """sigma = lambda tr(eps) I + 2 mu eps."""
    strain = symmetric(np.random.default_rng(seed))
    lam, mu = young * nu / (1 + nu) / (1 - 2 * nu), young / 2 / (1 + nu)
    expected = lam * np.trace(strain) * np.eye(3) + 2 * mu * strain
    found = stress_of(Stiffness.isotropic(young, nu), strain)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("axis", range(3))
def test_an_orthotropic_cube_pulled_along_an_axis_shows_the_moduli_it_was_given(axis):
    stress = np.zeros((3, 3))
    stress[axis, axis] = 1.0
    strain = strain_of(Stiffness.orthotropic(**WOOD), stress)
    assert 1 / strain[axis, axis] == pytest.approx(WOOD["young"][axis], rel=1e-9)
    for pair, ratio in zip(AXES, WOOD["poisson"], strict=True):
        if pair[0] == axis:
            assert -strain[pair[1], pair[1]] / strain[axis, axis] == pytest.approx(ratio, rel=1e-9)


@pytest.mark.parametrize(("pair", "modulus"), list(zip(AXES, WOOD["shear"], strict=True)))
def test_an_orthotropic_cube_sheared_shows_the_modulus_of_that_plane(pair, modulus):
    """tau = G gamma with gamma = 2 eps."""
    stress = np.zeros((3, 3))
    stress[pair], stress[pair[::-1]] = 1.0, 1.0
    strain = strain_of(Stiffness.orthotropic(**WOOD), stress)
    assert 1 / (2 * strain[pair]) == pytest.approx(modulus, rel=1e-9)


@given(seed=seeds, angle=st.floats(0, 6.3, allow_subnormal=False))
def test_one_axis_is_the_same_all_round_it(seed, angle):
    reed = Stiffness.one_axis(10e9, 1e9, 0.3, 0.4, 0.7e9)
    c, s = np.cos(angle), np.sin(angle)
    turned = reed.rotated([[1, 0, 0], [0, c, -s], [0, s, c]])
    np.testing.assert_allclose(turned.matrix, reed.matrix, atol=1e-9 * reed.matrix.max())
    assert reed.young_along((1, 0, 0)) == pytest.approx(10e9)
    assert reed.young_along((0, c, s)) == pytest.approx(1e9)


@given(seed=seeds)
def test_a_turned_material_answers_a_turned_strain_with_the_turned_stress(seed):
    rng = np.random.default_rng(seed)
    stiffness, R, strain = any_stiffness(rng), rotation(rng), symmetric(rng)
    expected = R @ stress_of(stiffness, strain) @ R.T
    found = stress_of(stiffness.rotated(R), R @ strain @ R.T)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


@given(seed=seeds)
def test_the_tensor_says_the_same_as_the_matrix(seed):
    rng = np.random.default_rng(seed)
    stiffness, strain = any_stiffness(rng), symmetric(rng)
    expected = np.einsum("ijkl,kl->ij", stiffness.tensor, strain)
    np.testing.assert_allclose(stress_of(stiffness, strain), expected, atol=1e-9 * np.abs(expected).max())


@given(seed=seeds)
def test_compliance_turns_stress_back_into_strain(seed):
    """Eq. 2.23: of a bar of wood pulled or sheared it shows 1 / E, -nu / E and 1 / G."""
    rng = np.random.default_rng(seed)
    stiffness, strain = any_stiffness(rng), symmetric(rng)
    stress = stress_of(stiffness, strain)
    rows = stiffness.compliance @ [stress[0, 0], stress[1, 1], stress[2, 2], *(stress[pair] for pair in AXES)]
    expected = [strain[0, 0], strain[1, 1], strain[2, 2], *(2 * strain[pair] for pair in AXES)]
    np.testing.assert_allclose(rows, expected, atol=1e-9 * np.abs(expected).max())
    wood = Stiffness.orthotropic(**WOOD).compliance
    np.testing.assert_allclose(np.diag(wood), 1 / np.array([*WOOD["young"], *WOOD["shear"]]))
    assert wood[0, 2] == pytest.approx(-WOOD["poisson"][1] / WOOD["young"][0])


@given(seed=seeds)
def test_youngs_modulus_along_any_direction_is_that_of_a_pulled_bar(seed):
    rng = np.random.default_rng(seed)
    stiffness, n = any_stiffness(rng), rng.normal(size=3)
    n = n / np.linalg.norm(n)
    along = n @ strain_of(stiffness, np.outer(n, n)) @ n
    assert stiffness.young_along(3 * n) == pytest.approx(1 / along, rel=1e-9)


def test_the_thesiss_constants_are_read_in_its_order_and_for_tensor_shear():
    """Eq. 2.34 and 2.35: c44 = E / (1 + nu), which is 2 G, for sigma_xy = c44 eps_xy."""
    E, nu = 2e6, 0.3
    k = E / (1 + nu) / (1 - 2 * nu)
    thesis = np.diag([k * (1 - nu)] * 3 + [E / (1 + nu)] * 3)
    thesis[:3, :3] += k * nu * (1 - np.eye(3))
    found = Stiffness.from_thesis(thesis)
    np.testing.assert_allclose(found.matrix, Stiffness.isotropic(E, nu).matrix, rtol=1e-9, atol=1e-6)


@given(seed=seeds)
def test_the_thesiss_form_gives_the_same_stress(seed):
    """sigma_(xx, yy, zz, xy, xz, yz) = c eps, with eps_xy itself."""
    rng = np.random.default_rng(seed)
    stiffness, strain = any_stiffness(rng), symmetric(rng)
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    thesis = stiffness.to_thesis()
    found = thesis @ [strain[pair] for pair in order]
    stress = stress_of(stiffness, strain)
    expected = np.array([stress[pair] for pair in order])
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(Stiffness.from_thesis(thesis).matrix, stiffness.matrix, rtol=1e-12)


ABOUT_Z = [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]
CLASSES = {
    "isotropic": Stiffness.isotropic(1e6, 0.3),
    "one axis": Stiffness.one_axis(10e9, 1e9, 0.3, 0.4, 0.7e9),
    "orthotropic": Stiffness.orthotropic(**WOOD),
    "one plane": Stiffness.orthotropic(**WOOD).rotated(ABOUT_Z),
    "none": any_stiffness(np.random.default_rng(1)),
}
CONSTANTS = {"isotropic": 2, "one axis": 5, "orthotropic": 9, "one plane": 13, "none": 21}


@pytest.mark.parametrize("name", CLASSES)
def test_the_class_of_symmetry_is_recognised(name):
    assert CLASSES[name].symmetry() == name


def changed(matrix, *entries):
    """With 5e4 Pa more in each entry (row, column, times), and in the one across the diagonal."""
    c = matrix.copy()
    for row, column, times in entries:
        c[row, column] += 5e4 * times
        c[column, row] = c[row, column]
    return Stiffness(c)


FLAT = Stiffness.orthotropic((3e6, 2e6, 2.5e6), (0.3, 0.2, 0.25), (8e5, 1e6, 9e5)).matrix
ROUND = Stiffness.one_axis(3e6, 2e6, 0.3, 0.2, 1e6).matrix
EVEN = Stiffness.isotropic(2e6, 0.3).matrix


@pytest.mark.parametrize(
    ("matrix", "entries", "name"),
    [
        *((FLAT, [(row, column, 1)], "none") for row in range(3) for column in (3, 4)),
        *((FLAT, [entry], "none") for entry in ((3, 5, 1), (4, 5, 1))),
        *((FLAT, [entry], "one plane") for entry in ((0, 5, 1), (1, 5, 1), (2, 5, 1), (3, 4, 1))),
        (ROUND, [(1, 1, 2), (3, 3, 1)], "orthotropic"),  # c22 and c33 apart, c44 = (c22 - c23) / 2 kept
        (ROUND, [(0, 1, 1)], "orthotropic"),
        (ROUND, [(4, 4, 1)], "orthotropic"),
        (ROUND, [(3, 3, 1)], "orthotropic"),
        (EVEN, [(3, 3, 1)], "orthotropic"),
        (EVEN, [(0, 0, 1)], "one axis"),
        (EVEN, [(0, 1, 1), (0, 2, 1)], "one axis"),
        (EVEN, [(4, 4, 1), (5, 5, 1)], "one axis"),
        (EVEN, [(0, 0, 1e-9)], "isotropic"),
    ],
)
def test_each_condition_of_a_symmetry_counts_by_itself(matrix, entries, name):
    assert changed(matrix, *entries).symmetry() == name


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_has_as_many_constants_as_the_book_says(name):
    """The rank of all stiffnesses that keep the class's symmetry: averaged over its rotations."""
    half, none = np.diag([-1.0, -1, 1]), np.eye(3)
    angles = np.linspace(0, 2 * np.pi, 6)[:-1] + 0.1
    about_x = [np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]) for a in angles]
    about_z = [np.roll(np.roll(R, 2, axis=0), 2, axis=1) for R in about_x]
    flat = [np.diag([1.0, -1, -1]), half]
    groups = {
        "none": [[none]],
        "one plane": [[none, half]],
        "orthotropic": [[none, half], [none, flat[0]]],
        "one axis": [[none, half], about_x],
        "isotropic": [about_x, about_z] * 12,
    }
    rng = np.random.default_rng(0)
    rows = []
    for _ in range(24):
        tensor = any_stiffness(rng).tensor
        for group in groups[name]:
            tensor = np.mean([np.einsum("ai,bj,ck,dl,ijkl->abcd", R, R, R, R, tensor) for R in group], axis=0)
        rows.append(tensor.ravel() / np.abs(tensor).max())
    assert np.linalg.matrix_rank(np.array(rows), tol=1e-3) == CONSTANTS[name]


def test_thirteen_constants_make_one_plane_of_symmetry():
    """Entry by entry; and the plane is that of x and y: half a turn about z changes nothing."""
    values = [30, 5, 6, 2, 20, 7, 3, 25, 1, 9, 4, 8, 11]
    found = Stiffness.one_plane(values)
    upper = [(i, j) for i in range(6) for j in range(i, 6) if found.matrix[i, j] != 0]
    assert [found.matrix[i, j] for i, j in upper] == values
    assert found.symmetry() == "one plane"
    np.testing.assert_allclose(found.rotated([0, 0, 1, 0]).matrix, found.matrix, atol=1e-12)
    with pytest.raises(OptionError, match=r"constants.*\(13,\)"):
        Stiffness.one_plane(values[:9])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Stiffness.isotropic(1e6, -1),
        lambda: Stiffness.isotropic(1e6, 0.5),
        lambda: Stiffness.isotropic("1e6", 0.3),
        lambda: Stiffness.isotropic(0, 0.3),
        lambda: Stiffness.isotropic(1e6, None),
        lambda: Stiffness.one_axis(1e6, 1e6, 0.3, -1, 1e6),
        lambda: Stiffness.one_axis(1e6, "soft", 0.3, 0.2, 1e6),
        lambda: Stiffness.isotropic(1e30, 0.3),
        lambda: Stiffness.isotropic(1e-30, 0.3),
        lambda: Stiffness.isotropic(1e6, 0.5 - 1e-13),
    ],
)
def test_constants_out_of_range_are_refused_in_one_line(make):
    with pytest.raises((MaterialError, OptionError), match=r"must be|must lie"):
        make()


def test_the_matrix_cannot_be_changed_behind_its_back():
    given = np.eye(6)
    stiffness = Stiffness(given)
    given[0, 0] = -1
    assert stiffness.matrix[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        stiffness.matrix[0, 0] = 5


LOPSIDED = np.eye(6)
LOPSIDED[0, 1] = 0.5


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        (LOPSIDED, r"symmetric.*\(0, 1\).*0\.5.*\(1, 0\).*0"),
        (np.diag([1, 1, 1, 1, 1, -2.0]), "eigenvalue -2 Pa"),
        (np.diag([1, 1, 1, 1, 1, 0.0]), "eigenvalue 0 Pa"),
        (np.zeros((6, 6)), "eigenvalue 0 Pa"),
    ],
)
def test_what_is_no_stiffness_is_refused(matrix, said):
    with pytest.raises(MaterialError, match=said):
        Stiffness(matrix)


@pytest.mark.parametrize("matrix", [None, np.eye(5), np.full((6, 6), np.nan), "stiff", [[1], [1, 2]]])
def test_what_is_no_matrix_is_refused(matrix):
    with pytest.raises(OptionError, match="stiffness"):
        Stiffness(matrix)


@pytest.mark.parametrize(
    ("constants", "said"),
    [
        ({"young": (1e6, 0, 1e6)}, "young"),
        ({"shear": (1e6, -1, 1e6)}, "shear"),
        ({"poisson": (0.9, 0.9, 0.9)}, "eigenvalue"),
    ],
)
def test_impossible_constants_are_refused(constants, said):
    usual = {"young": (1e6,) * 3, "poisson": (0.3,) * 3, "shear": (4e5,) * 3}
    with pytest.raises(MaterialError, match=said):
        Stiffness.orthotropic(**{**usual, **constants})


def test_a_bar_of_no_direction_is_refused():
    with pytest.raises(MaterialError, match="direction is zero"):
        Stiffness.isotropic(1e6, 0.3).young_along((0, 0, 0))
