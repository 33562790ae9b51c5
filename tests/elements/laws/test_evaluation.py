"""`internal_forces`: its precision, and the arguments that it refuses."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, MeshError, OptionError, ParticleMesh, internal_forces
from taichi_soft.core.errors import MaterialError

pytestmark = pytest.mark.kernel

MESHES = oracle.MESHES
BALL = MESHES["sphere"]
MATERIAL = Material(1e6, 0.3, 1000.0, 50.0)


@pytest.mark.parametrize(
    ("law", "strain", "flips"),
    [
        ("virial", "linear", "tolerant"),
        pytest.param("virial", "exact", "off", marks=pytest.mark.soak),
        pytest.param("face", "linear", "recover", marks=pytest.mark.soak),
        pytest.param("face", "exact", "recover", marks=pytest.mark.soak),
    ],
)
@settings(max_examples=8)
@given(
    seed=st.integers(0, 2**32 - 1),
    name=st.sampled_from(list(MESHES)),
    amount=st.sampled_from([0.1, 0.3]),
    model=st.sampled_from(["edge", "tet_mean"]),
)
def test_float32_is_close_to_float64(law, strain, flips, seed, name, amount, model):
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    # Numbers that float32 holds, so that only the computation differs.
    x = oracle.shaken(mesh, rng, amount).astype(np.float32)
    v = rng.normal(size=x.shape).astype(np.float32)
    options = {"law": law, "strain": strain, "flips": flips, "damping_model": model}
    double = internal_forces(mesh, MATERIAL, x, v, **options)
    single = internal_forces(mesh, MATERIAL, x, v, **options, dtype=np.float32)
    assert double.dtype == np.float64
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, double, atol=1e-4 * np.abs(double).max())


@pytest.mark.parametrize("strain", oracle.STRAINS)
def test_float32_at_rest_is_still_to_seven_digits_of_the_modulus(strain):
    forces = internal_forces(BALL, MATERIAL, BALL.vertices, strain=strain, dtype=np.float32)
    assert np.abs(forces).max() < 1e6 * 2e-6 * BALL.edge_lengths.max() ** 2


def test_the_inputs_are_left_alone():
    x, v = BALL.vertices + 0.1, np.ones_like(BALL.vertices)
    before = x.copy(), v.copy()
    internal_forces(BALL, MATERIAL, x, v)
    assert x.tobytes() == before[0].tobytes()
    assert v.tobytes() == before[1].tobytes()


def test_every_layout_of_the_same_numbers_gives_the_same_forces():
    x = oracle.shaken(BALL, np.random.default_rng(0), 0.2)
    expected = internal_forces(BALL, MATERIAL, x).tobytes()
    assert internal_forces(BALL, MATERIAL, x.tolist()).tobytes() == expected
    assert internal_forces(BALL, MATERIAL, np.asfortranarray(x)).tobytes() == expected
    assert internal_forces(BALL, MATERIAL, np.repeat(x, 2, axis=0)[::2]).tobytes() == expected


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [
        ("law", "spring", "law 'spring'.*'virial', 'face'"),
        ("law", "", "unknown law"),
        ("law", None, "unknown law"),
        ("strain", "cubic", "strain 'cubic'.*'linear', 'exact'"),
        ("strain", 3, "unknown strain 3"),
        ("flips", "maybe", "flips 'maybe'.*'tolerant', 'recover', 'off'"),
        ("damping_model", "air", "damping_model 'air'.*'edge', 'tet_mean'"),
        ("dtype", np.float16, "dtype.*float64.*float32, got float16"),
        ("dtype", np.int32, "dtype.*float64.*float32, got int32"),
        ("dtype", "complex128", "dtype.*float64.*float32, got complex128"),
    ],
)
def test_unknown_choices_are_refused_with_the_list(option, value, text):
    with pytest.raises(OptionError, match=text):
        internal_forces(BALL, MATERIAL, BALL.vertices, **{option: value})


def test_choices_may_be_enum_members():
    from taichi_soft.core.types import DampingModel, Flips, Strain

    x = oracle.shaken(BALL, np.random.default_rng(0), 0.2)
    by_name = internal_forces(BALL, MATERIAL, x, x, strain="exact", flips="off", damping_model="edge")
    members = {"strain": Strain.EXACT, "flips": Flips.OFF, "damping_model": DampingModel.EDGE}
    assert internal_forces(BALL, MATERIAL, x, x, **members).tobytes() == by_name.tobytes()


@pytest.mark.parametrize("name", ["positions", "velocities"])
@pytest.mark.parametrize(
    "shape",
    [(0, 3), (len(BALL.vertices) - 1, 3), (len(BALL.vertices), 2), (3,), (), (1, len(BALL.vertices), 3)],
)
def test_arrays_of_another_shape_are_refused_with_both_shapes(name, shape):
    arrays = {"positions": BALL.vertices, "velocities": BALL.vertices, name: np.zeros(shape)}
    with pytest.raises(MeshError) as caught:
        internal_forces(BALL, MATERIAL, **arrays)
    assert str(caught.value) == f"{name} has shape {shape}: this mesh needs {BALL.vertices.shape}"


@pytest.mark.parametrize("name", ["positions", "velocities"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_the_first_vertex_that_is_not_finite_is_named(name, value):
    rows = BALL.vertices.copy()
    rows[5, 2] = rows[9, 0] = value
    with pytest.raises(MeshError, match=rf"{name}\[5\] is not finite"):
        internal_forces(
            BALL, MATERIAL, **{"positions": BALL.vertices, "velocities": BALL.vertices, name: rows}
        )


@pytest.mark.parametrize("value", ["here", None, [[1, 2, 3], [4]], {"x": 1}])
def test_positions_that_are_no_numbers_are_refused(value):
    with pytest.raises(MeshError, match="positions"):
        internal_forces(BALL, MATERIAL, value)


@pytest.mark.parametrize("value", [None, "ball", BALL.vertices, MATERIAL])
def test_what_is_no_mesh_is_refused(value):
    with pytest.raises(MeshError, match=r"mesh.*TetMesh.*ParticleMesh"):
        internal_forces(value, MATERIAL, BALL.vertices)


def test_a_mesh_without_tetrahedra_is_refused():
    rod = ParticleMesh([[0, 0, 0], [1, 0, 0]], [[0, 1]], [1.0, 1.0])
    with pytest.raises(MeshError, match=r"'virial'.*no tetrahedra.*law='springs'"):
        internal_forces(rod, MATERIAL, rod.vertices)


@pytest.mark.parametrize("value", [None, 1e6, "cork"])
def test_what_is_no_material_is_refused(value):
    with pytest.raises(MaterialError, match="got"):
        internal_forces(BALL, value, BALL.vertices)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"law": []}, OptionError),
        ({"dtype": "banana"}, OptionError),
        ({"positions": BALL.vertices + 1j}, MeshError),
        ({"positions": BALL.vertices.astype(str)}, MeshError),
        ({"positions": BALL.vertices + 1e12, "dtype": np.float32}, MeshError),
        ({"material": Material(1e5, 0.1, np.full(3, 1000.0))}, MaterialError),
    ],
)
def test_what_would_be_misread_or_overflow_is_refused(options, error):
    given_values = {
        "mesh": BALL,
        "material": Material(1e5, 0.1, 1000.0),
        "positions": BALL.vertices,
        **options,
    }
    with pytest.raises(error):
        internal_forces(**given_values)
