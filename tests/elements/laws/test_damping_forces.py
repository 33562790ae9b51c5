"""Damping inside a body: motions that it brakes, and motions that it must not affect."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, TetMesh, internal_forces

pytestmark = pytest.mark.kernel

MESHES = oracle.MESHES
names = st.sampled_from(list(MESHES))
seeds = st.integers(0, 2**32 - 1)
amounts = st.floats(0, 2)


def damping_forces(mesh, material, x, v, model):
    """Return the part of the forces that is due to velocities."""
    moving = internal_forces(mesh, material, x, v, damping_model=model)
    still = internal_forces(mesh, material, x, damping_model=model)
    return moving - still


def damped(b):
    """Make a body so soft that elastic forces cause no round-off in the damping."""
    return Material(1e-3, 0.2, 1000.0, b)


def tumbling(x, rng):
    """Velocities of a body that flies and turns."""
    return rng.normal(size=3) + np.cross(rng.normal(size=3), x)


@settings(max_examples=25)
@given(seed=seeds, name=names, amount=amounts, model=st.sampled_from(["edge", "tet_mean"]))
def test_damping_equals_the_equations_in_numpy(seed, name, amount, model):
    """Each tetrahedron has its own b. An edge uses the mean of the tetrahedra around it."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    b = rng.uniform(0, 100, len(mesh.tets))
    x = oracle.shaken(mesh, rng, amount)
    v = rng.normal(size=x.shape)
    forces = damping_forces(mesh, damped(b), x, v, model)
    if model == "edge":
        expected = oracle.edge_damping_forces(mesh, b, x, v)
    else:
        expected = oracle.mean_damping_forces(mesh, b, v)
    np.testing.assert_allclose(forces, expected, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("model", ["edge", "tet_mean"])
@settings(max_examples=10)
@given(seed=seeds, name=names)
def test_damping_is_added_to_the_elastic_forces(model, seed, name):
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    material = oracle.uneven_material(mesh, rng, damping=1e4)
    x = oracle.shaken(mesh, rng, 0.1)
    v = rng.normal(size=x.shape)
    expected = oracle.elastic_forces(mesh, material.young, material.poisson, x)
    if model == "edge":
        expected += oracle.edge_damping_forces(mesh, material.damping, x, v)
    else:
        expected += oracle.mean_damping_forces(mesh, material.damping, v)
    forces = internal_forces(mesh, material, x, v, damping_model=model)
    np.testing.assert_allclose(forces, expected, atol=1e-10 * np.abs(expected).max())


def test_one_damping_constant_belongs_to_an_edge_however_many_tetrahedra_share_it():
    """Two tetrahedra on one face: b of the shared edges is the mean, and equal values do not add up."""
    mesh = TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], [[0, 1, 2, 3], [0, 2, 1, 4]])
    v = np.zeros((5, 3))
    v[1] = 2, 0, 0  # along edge 0-1, across all others of vertex 0
    assert damping_forces(mesh, damped(10.0), mesh.vertices, v, "edge")[0] == pytest.approx(
        [20, 0, 0], abs=1e-9
    )
    uneven = damping_forces(mesh, damped([10.0, 40.0]), mesh.vertices, v, "edge")
    assert uneven[0] == pytest.approx([50, 0, 0], abs=1e-9)


@settings(max_examples=25)
@given(seed=seeds, name=names, amount=amounts)
def test_edge_damping_leaves_rigid_motion_alone(seed, name, amount):
    """Translation and rotation, of the rest shape or of a deformed one."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    x = oracle.shaken(mesh, rng, amount)
    v = tumbling(x, rng)
    forces = damping_forces(mesh, damped(100.0), x, v, "edge")
    assert np.abs(forces).max() < 1e-11 * 100 * np.abs(v).max()


@settings(max_examples=25)
@given(seed=seeds, name=names)
def test_mean_damping_brakes_rotation_which_is_why_the_thesis_rejects_it(seed, name):
    """By section 6.4, this damping does not affect translation, but it brakes rotation."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    x = mesh.vertices
    fly = np.tile(rng.normal(size=3), (len(x), 1))
    assert np.abs(damping_forces(mesh, damped(100.0), x, fly, "tet_mean")).max() < 1e-10
    turn = np.cross(rng.normal(size=3), x - x.mean(axis=0))
    forces = damping_forces(mesh, damped(100.0), x, turn, "tet_mean")
    assert np.sum(forces * turn) < -1.0 * np.sum(turn**2)
    moment = np.cross(x, forces).sum(axis=0)
    assert np.dot(moment, np.cross(x, turn).sum(axis=0)) < 0  # it takes angular momentum away


@settings(max_examples=25)
@given(seed=seeds, name=names, amount=amounts)
def test_edge_damping_conserves_momentum_and_angular_momentum(seed, name, amount):
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    x = oracle.shaken(mesh, rng, amount)
    forces = damping_forces(
        mesh, damped(rng.uniform(1, 100, len(mesh.tets))), x, rng.normal(size=x.shape), "edge"
    )
    scale = np.abs(forces).sum()
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * scale
    assert np.abs(np.cross(x, forces).sum(axis=0)).max() < 1e-12 * scale * np.abs(x).max()


@settings(max_examples=40)
@given(
    seed=seeds, name=names, amount=amounts, model=st.sampled_from(["edge", "tet_mean"]), rigid=st.booleans()
)
def test_damping_never_adds_energy(seed, name, amount, model, rigid):
    """The power of its forces is negative, or round-off."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    x = oracle.shaken(mesh, rng, amount)
    v = tumbling(x, rng) if rigid else rng.normal(size=x.shape)
    forces = damping_forces(mesh, damped(rng.uniform(0, 100, len(mesh.tets))), x, v, model)
    power = np.sum(forces * v)
    assert power < (1e-9 if rigid else 0.0)


@pytest.mark.parametrize("model", ["edge", "tet_mean"])
def test_damping_is_proportional_to_velocity_and_constant(model):
    rng = np.random.default_rng(5)
    mesh = MESHES["sphere"]
    x, v = oracle.shaken(mesh, rng, 0.3), rng.normal(size=mesh.vertices.shape)
    once = damping_forces(mesh, damped(3.0), x, v, model)
    for forces in (
        damping_forces(mesh, damped(6.0), x, v, model),
        damping_forces(mesh, damped(3.0), x, 2 * v, model),
    ):
        np.testing.assert_allclose(forces, 2 * once, atol=1e-10)
    assert np.abs(damping_forces(mesh, damped(0.0), x, v, model)).max() == 0


@pytest.mark.parametrize("model", ["edge", "tet_mean"])
def test_without_velocities_nothing_is_damped(model):
    mesh = MESHES["sphere"]
    x = oracle.shaken(mesh, np.random.default_rng(6), 0.1)
    with_b, without = (
        internal_forces(mesh, Material(1e5, 0.2, 1000.0, b), x, damping_model=model) for b in (100.0, 0.0)
    )
    assert with_b.tobytes() == without.tobytes()


def test_an_edge_of_no_length_is_not_damped():
    """Such an edge has no direction. The other edges of its tetrahedron are damped as usual."""
    x = oracle.ONE_TET.vertices.copy()
    x[1] = x[0]
    v = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    forces = damping_forces(oracle.ONE_TET, damped(10.0), x, v, "edge")
    with np.errstate(invalid="ignore"):
        pairs = {(p, q): x[q] - x[p] for p in range(4) for q in range(p + 1, 4) if (p, q) != (0, 1)}
    expected = np.zeros((4, 3))
    for (p, q), r in pairs.items():
        n = r / np.linalg.norm(r)
        expected[p] += 10 * np.dot(v[q] - v[p], n) * n
        expected[q] -= 10 * np.dot(v[q] - v[p], n) * n
    np.testing.assert_allclose(forces, expected, atol=1e-9)
