"""Materials with a direction: their frames, and refused arguments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_soft import (
    AnisotropicMaterial,
    MaterialError,
    MeshError,
    OptionError,
    ParticleMesh,
    Stiffness,
    TetMesh,
    box,
    frames_along,
    internal_forces,
)
from taichi_soft.core.serialisation import as_plain, from_plain
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.numpy

WOOD = Stiffness.orthotropic((10e9, 1e9, 0.6e9), (0.4, 0.35, 0.3), (0.1e9, 0.6e9, 0.7e9))
CUBE = box((1, 1, 1), (1, 1, 1))
COUNT = len(CUBE.tets)
HALF = 0.5**0.5
seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds)
def test_frames_point_their_first_axis_along_the_fibres(seed):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(5, 3)) * rng.uniform(1e-3, 1e3, (5, 1))
    frames = frames_along(directions)
    np.testing.assert_allclose(
        frames @ np.swapaxes(frames, 1, 2), np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-9)
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(frames[:, :, 0], directions / lengths, atol=1e-9)


def test_fibres_straight_on_and_straight_back_have_frames_too():
    frames = frames_along([[2, 0, 0], [-1, 0, 0], [-1, 1e-7, 0]])
    np.testing.assert_allclose(frames[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(frames[1], np.diag([-1, -1, 1]), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1, atol=1e-6)
    np.testing.assert_allclose(frames[2, :, 0], [-1, 1e-7, 0], atol=1e-6)


def test_a_material_with_fibres_is_stiff_along_them():
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(4, 3))
    reed = AnisotropicMaterial(
        Stiffness.one_axis(10e9, 1e9, 0.3, 0.4, 0.7e9), 500.0, frame=frames_along(directions)
    )
    for matrix, n in zip(reed.stiffness_matrices(4), directions, strict=True):
        assert Stiffness(matrix).young_along(n) == pytest.approx(10e9, rel=1e-6)
        assert Stiffness(matrix).young_along(np.cross(n, [1, 2, 3])) == pytest.approx(1e9, rel=1e-6)


@pytest.mark.parametrize(
    "frame", [[0, 0, HALF, HALF], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], np.tile([0, 0, HALF, HALF], (COUNT, 1))]
)
def test_a_frame_is_a_matrix_or_a_quaternion_for_all_or_one_per_tetrahedron(frame):
    """A quarter turn about z: what is stiff along x is stiff along y."""
    matrices = AnisotropicMaterial(WOOD, 500.0, frame=frame).stiffness_matrices(COUNT)
    assert matrices.shape == (COUNT, 6, 6)
    for matrix in matrices:
        turned = Stiffness(matrix)
        assert turned.young_along([0, 1, 0]) == pytest.approx(10e9)
        assert turned.young_along([1, 0, 0]) == pytest.approx(1e9)
        np.testing.assert_allclose(turned.matrix, WOOD.rotated([0, 0, HALF, HALF]).matrix, atol=1e-2)


def test_each_tetrahedron_may_have_a_stiffness_and_a_frame_of_its_own():
    """A quarter turn about z takes x to y; forces are those of the tetrahedra alone, each with its own."""
    kinds = [WOOD, WOOD.rotated([0, 0, HALF, HALF]), Stiffness.isotropic(2e9, 0.3)]
    own = [kinds[t % 3] for t in range(COUNT)]
    frames = np.stack([np.eye(3), [[0, -1, 0], [1, 0, 0], [0, 0, 1]]])[np.arange(COUNT) % 2]
    mixed = AnisotropicMaterial(own, 500.0, frame=frames)
    turn = {0: [0, 0, 0, 1], 1: [0, 0, HALF, HALF]}
    for t, matrix in enumerate(mixed.stiffness_matrices(COUNT)):
        np.testing.assert_allclose(matrix, own[t].rotated(turn[t % 2]).matrix, atol=1e-2)
    moved = CUBE.vertices + 0.05 * np.random.default_rng(1).normal(size=CUBE.vertices.shape)
    alone = np.zeros_like(moved)
    for t, tet in enumerate(CUBE.tets):
        one = TetMesh(CUBE.vertices[tet], [[0, 1, 2, 3]])
        alone[tet] += internal_forces(one, mixed.of_tets(np.array([t])), moved[tet])
    np.testing.assert_allclose(internal_forces(CUBE, mixed, moved), alone, rtol=1e-6, atol=1e-2)
    again = from_plain(as_plain(mixed))
    np.testing.assert_array_equal(again.stiffness_matrices(COUNT), mixed.stiffness_matrices(COUNT))
    assert repr(mixed).startswith("AnisotropicMaterial(stiffness=<5 values>, density=500")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], 500.0), "got list"),
        (([WOOD, 3.0], 500.0), "one per tetrahedron.*float"),
        (([WOOD] * 3, [500.0, 500.0]), "arrays of different lengths"),
        ((1e6, 500.0), r"stiffness.*taichi_soft\.Stiffness.*float"),
        ((np.eye(6), 500.0), r"got ndarray: make it with Stiffness\.orthotropic"),
        ((WOOD, 0.0), "density is 0"),
        ((WOOD, [500.0, -1.0]), "density of tetrahedron 1 is -1"),
        ((WOOD, 500.0, -1.0), "damping is -1"),
        ((WOOD, "oak"), "density.*one number per tetrahedron"),
        ((WOOD, 500.0, 0.0, np.diag([1, 1, -1])), r"rotation.*orthonormal.*\+1"),
        ((WOOD, 500.0, 0.0, np.stack([np.eye(3), 2 * np.eye(3)])), "frame 1.*orthonormal"),
        ((WOOD, 500.0, 0.0, [0, 0, 0, 0]), "quaternion of length 0"),
        ((WOOD, 500.0, 0.0, [[0, 0, 0, 1], [0, 0, 1, 1]]), "frame 1.*length 1.41"),
        ((WOOD, 500.0, 0.0, np.full((2, 3, 3), np.nan)), "frame must be finite"),
        ((WOOD, 500.0, 0.0, "along x"), "must be numbers"),
        ((WOOD, 500.0, 0.0, np.zeros((2, 5))), "frame must have shape"),
        ((WOOD, [500.0, 500.0], 0.0, np.stack([np.eye(3)] * 3)), "arrays of different lengths"),
    ],
)
def test_bad_constants_are_refused(arguments, message):
    with pytest.raises((MaterialError, OptionError), match=message):
        AnisotropicMaterial(*arguments)


@pytest.mark.parametrize(
    ("directions", "message"),
    [
        ([[1, 0, 0], [0, 0, 0]], "directions 1 is zero"),
        (np.zeros((0, 3)), "directions are missing"),
        ([1, 0, 0], "directions must have shape"),
        ([[np.nan, 0, 0]], "directions must be finite"),
    ],
)
def test_directions_that_are_none_are_refused(directions, message):
    with pytest.raises((MaterialError, OptionError), match=message):
        frames_along(directions)


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (
            AnisotropicMaterial(WOOD, 500.0, frame=np.stack([np.eye(3)] * 3)),
            "frame.*3 rotations.*5",
        ),
        (AnisotropicMaterial([WOOD] * 4, 500.0), "stiffness.*4 entries.*5"),
        (AnisotropicMaterial(WOOD, [500.0] * 4), "density.*4 values.*5"),
        (AnisotropicMaterial(WOOD, 500.0, [1.0] * 7), "damping.*7 values.*5"),
    ],
)
def test_constants_for_another_mesh_are_refused(material, message):
    with pytest.raises(MaterialError, match=message):
        internal_forces(CUBE, material, CUBE.vertices)


@pytest.mark.parametrize("law", ["neo_hookean", "springs", "volume_springs", "cmpm2"])
def test_laws_that_know_no_direction_refuse_it_and_name_those_that_do(law):
    world = bare_world()
    message = f"does not support law '{law}', .*'virial', 'face' or 'st_venant_kirchhoff'"
    with pytest.raises(MaterialError, match=message):
        world.add_body(CUBE, AnisotropicMaterial(WOOD, 500.0), law=law)
    assert world.bodies == ()


def test_particles_have_no_frames():
    rope = ParticleMesh([[0, 0, 0], [1, 0, 0]], [[0, 1]], 1.0)
    with pytest.raises(MeshError, match="no tetrahedra"):
        internal_forces(rope, AnisotropicMaterial(WOOD, 500.0), rope.vertices, law="springs")


def test_edges_are_damped_only_where_that_is_asked_for():
    assert AnisotropicMaterial(WOOD, 500.0).damping == 0.0


def test_the_material_of_some_tetrahedra_has_their_values_and_those_given_for_all():
    frames = frames_along(np.random.default_rng(2).normal(size=(4, 3)))
    rows = np.array([2, 0, 2])
    each = AnisotropicMaterial(WOOD, np.arange(1.0, 5.0), damping=np.arange(4.0), frame=frames)
    some = each.of_tets(rows)
    assert some.density.tolist() == [3.0, 1.0, 3.0]
    assert some.damping.tolist() == [2.0, 0.0, 2.0]
    assert np.array_equal(some.frame, frames[rows])
    one = AnisotropicMaterial(WOOD, 500.0, damping=2.0, frame=frames[1])
    same = one.of_tets(rows)
    assert (same.density, same.damping) == (500.0, 2.0)
    assert np.array_equal(same.frame, frames[1])


@pytest.mark.parametrize("ratio", [-0.001, 1000.1, np.nan])
def test_a_damping_ratio_out_of_range_is_refused(ratio):
    with pytest.raises(MaterialError, match=r"damping_ratio.*0 to 1000"):
        AnisotropicMaterial(WOOD, 500.0, damping_ratio=ratio)
