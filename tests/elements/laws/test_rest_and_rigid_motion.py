"""A rigid motion causes no forces in a body, and forces rotate with the body."""

import force_oracle as oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taichi_soft import Material, internal_forces

pytestmark = pytest.mark.kernel

MESHES = oracle.MESHES
EACH_MODE = pytest.mark.parametrize(("law", "strain", "flips"), oracle.params_of(oracle.MODES))
STIFF = Material(1e6, 0.4, 1000.0)
seeds = st.integers(0, 2**32 - 1)

unit_quaternions = (
    st.lists(st.floats(-1, 1), min_size=4, max_size=4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)


def matrix_of(q):
    """Rotation matrix: v -> v + 2 w (u x v) + 2 u x (u x v)."""
    u, w = q[:3], q[3]
    cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


def round_off(mesh, reach=1.0):
    """Return the force that corresponds to the last bits of the positions: E eps times area."""
    return 1e6 * 4e-15 * reach * mesh.edge_lengths.max()


@EACH_MODE
@pytest.mark.parametrize("name", MESHES)
def test_no_force_at_rest(law, strain, flips, name):
    mesh = MESHES[name]
    forces = internal_forces(mesh, STIFF, mesh.vertices, law=law, strain=strain, flips=flips)
    assert np.abs(forces).max() < round_off(mesh)


@EACH_MODE
@settings(max_examples=12)
@given(
    name=st.sampled_from(list(MESHES)),
    q=unit_quaternions,
    shift=st.tuples(*[st.floats(-10, 10)] * 3),
)
def test_no_force_after_any_rotation_and_translation(law, strain, flips, name, q, shift):
    mesh = MESHES[name]
    x = mesh.vertices @ matrix_of(q).T + shift
    forces = internal_forces(mesh, STIFF, x, law=law, strain=strain, flips=flips)
    assert np.abs(forces).max() < round_off(mesh, 1 + np.linalg.norm(shift))


@EACH_MODE
@settings(max_examples=6)
@given(q=unit_quaternions, seed=seeds)
def test_forces_turn_with_a_deformed_body(law, strain, flips, q, seed):
    """Objectivity: f(Q x + t) = Q f(x), flipped tetrahedra included."""
    rng = np.random.default_rng(seed)
    mesh, Q = MESHES["sphere"], matrix_of(q)
    x = oracle.shaken(mesh, rng, 0.4)
    before = internal_forces(mesh, STIFF, x, law=law, strain=strain, flips=flips)
    after = internal_forces(mesh, STIFF, x @ Q.T + rng.normal(size=3), law=law, strain=strain, flips=flips)
    np.testing.assert_allclose(after, before @ Q.T, atol=1e-9 * np.abs(before).max())


@EACH_MODE
@settings(max_examples=5)
@given(seed=seeds)
def test_the_order_of_a_tetrahedrons_corners_does_not_matter(law, strain, flips, seed):
    """The first corner is where the shape matrix starts, and nothing else."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(4, 3))
    results = []
    for corners in ((0, 1, 2, 3), (2, 0, 1, 3), (3, 2, 1, 0)):
        mesh = type(oracle.ONE_TET)(oracle.ONE_TET.vertices, [corners])
        results.append(internal_forces(mesh, STIFF, x, law=law, strain=strain, flips=flips))
    scale = np.abs(results[0]).max()
    np.testing.assert_allclose(results[1], results[0], atol=1e-9 * scale)
    np.testing.assert_allclose(results[2], results[0], atol=1e-9 * scale)


@EACH_MODE
@settings(max_examples=5)
@given(seed=seeds)
def test_where_and_how_the_rest_shape_lies_does_not_matter(law, strain, flips, seed):
    """An isotropic material has no memory of directions."""
    rng = np.random.default_rng(seed)
    mesh = MESHES["box"]
    x = oracle.shaken(mesh, rng, 0.3)
    here = internal_forces(mesh, STIFF, x, law=law, strain=strain, flips=flips)
    moved = mesh.rotated(oracle.rotation(rng)).translated([1, -2, 3])
    there = internal_forces(moved, STIFF, x, law=law, strain=strain, flips=flips)
    np.testing.assert_allclose(there, here, atol=1e-9 * np.abs(here).max())


@pytest.mark.parametrize("strain", oracle.STRAINS)
@settings(max_examples=20)
@given(seed=seeds, name=st.sampled_from(list(MESHES)), nu=st.floats(-0.9, 0.45))
def test_small_deformation_is_always_resisted(strain, seed, name, nu):
    """The rest shape is a minimum: in every small displacement that is not rigid, forces do negative work."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    u = rng.normal(size=mesh.vertices.shape) * 1e-6
    forces = internal_forces(mesh, Material(1e6, nu, 1000.0), mesh.vertices + u, strain=strain)
    assert np.sum(forces * u) < 0


@settings(max_examples=10)
@given(seed=seeds, name=st.sampled_from(list(MESHES)))
def test_both_strains_agree_for_small_deformation(seed, name):
    """1/2 (U^2 - I) and U - I differ in the second order only."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[name]
    noise = rng.normal(size=mesh.vertices.shape)
    gaps = []
    for size in (1e-3, 1e-4):
        x = mesh.vertices + size * noise
        linear, exact = (internal_forces(mesh, STIFF, x, strain=strain) for strain in oracle.STRAINS)
        gaps.append(np.abs(linear - exact).max())
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.1)
