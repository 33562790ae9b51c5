"""Measurements of one body: pose compared with SciPy, strain and stress with closed forms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taichi_soft import MeshError, box, cloth, rope, sphere
from taichi_soft.bodies.pose import best_fitting_pose
from taichi_soft.elements.materials import SpringMaterial
from taichi_soft.world.bare import bare_world

RANDOM = np.random.default_rng(2)
TURNS = [np.eye(3), *Rotation.random(4, random_state=3).as_matrix()]
BALL = sphere(0.5, 3).vertices
SHAPES = {"ball": BALL, "flat": BALL * [1, 1, 0], "ball far away": np.add(BALL, [1e4, 0, -1e4])}


def misfit(rest, positions, masses, rotation, position):
    return masses @ ((rest @ rotation.T + position - positions) ** 2).sum(axis=1)


def assert_proper(rotation):
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("name", SHAPES)
def test_the_pose_of_a_body_that_only_moved_is_its_motion(name, turn):
    rest = SHAPES[name]
    masses = RANDOM.uniform(0.5, 2, len(rest))
    pose = best_fitting_pose(rest, rest @ turn.T + [3, -2, 1], masses)
    np.testing.assert_allclose(pose.rotation, turn, atol=1e-7)
    np.testing.assert_allclose(rest @ pose.rotation.T + pose.position, rest @ turn.T + [3, -2, 1], atol=1e-7)


@pytest.mark.parametrize(
    "stretch", [(1.3, 0.8, 1.1), (1, 1, 0), (-1.2, 0.9, 0.5), (-1, -1, -1), (1, -0.1, 1)]
)
def test_no_rotation_fits_better_than_the_pose(stretch):
    """The bodies include flat and inverted ones. SciPy weights vertices by mass, too."""
    rest = np.add(BALL, [0.3, 0, 0.1])
    positions = (rest * stretch) @ TURNS[2].T + RANDOM.normal(0, 0.02, rest.shape)
    masses = RANDOM.uniform(0.5, 2, len(rest))
    pose = best_fitting_pose(rest, positions, masses)
    assert_proper(pose.rotation)
    center, rest_center = (np.average(rows, axis=0, weights=masses) for rows in (positions, rest))
    best, _ = Rotation.align_vectors(positions - center, rest - rest_center, weights=masses)
    least = misfit(rest, positions, masses, best.as_matrix(), center - best.as_matrix() @ rest_center)
    assert misfit(rest, positions, masses, pose.rotation, pose.position) == pytest.approx(least, rel=1e-9)


def test_a_straight_rope_does_not_twist():
    """The shape does not determine a rotation about its own axis.

    The pose has the smallest possible rotation.
    """
    rest = np.linspace(0, 1, 6)[:, None] * [1, 0, 0]
    masses = np.ones(6)
    for end in ([0, 1, 0], [0.6, 0, -0.8], [1, 0, 0], [-0.8, 0.6, 0]):
        pose = best_fitting_pose(rest, rest[:, :1] * end, masses)
        assert_proper(pose.rotation)
        np.testing.assert_allclose(pose.rotation @ [1, 0, 0], end, atol=1e-8)
        angle = np.arccos(np.clip((np.trace(pose.rotation) - 1) / 2, -1, 1))
        assert angle == pytest.approx(np.arccos(end[0]), abs=1e-5)


def test_a_body_shrunk_to_a_point_is_not_turned():
    pose = best_fitting_pose(BALL, np.tile([1.0, 2, 3], (len(BALL), 1)), np.ones(len(BALL)))
    assert_proper(pose.rotation)
    np.testing.assert_allclose(pose.rotation, np.eye(3), atol=1e-4)
    np.testing.assert_allclose(pose.position + BALL.mean(axis=0), [1, 2, 3], atol=1e-4)


@pytest.fixture(scope="module")
def bodies(jelly):
    """A cube, a sheet and a rope."""
    world = bare_world(floor=None)
    world.add_body(box(cells=(2, 2, 2)), jelly)
    springs = SpringMaterial(stiffness=100.0)
    world.add_body(cloth((1, 1), (2, 2), 1.0), springs, law="springs")
    world.add_body(rope(1.0, 4, 1.0), springs, law="springs")
    world.build()
    yield world.bodies
    assert world.step_count == 0  # keeps a reference to the world; bodies have none


def put(body, positions):
    body.set_motion(positions, np.zeros_like(positions))


def test_poses_and_boxes_of_bodies(bodies):
    for body in bodies:
        rest = body.mesh.vertices
        put(body, rest @ TURNS[3].T + [1, 2, 3])
        pose = body.pose()
        assert_proper(pose.rotation)
        np.testing.assert_allclose(
            rest @ pose.rotation.T + pose.position, rest @ TURNS[3].T + [1, 2, 3], atol=1e-6
        )
        lower, upper = body.aabb()
        x = body.positions()
        assert lower.tolist() == [min(x[:, k]) for k in range(3)]
        assert upper.tolist() == [max(x[:, k]) for k in range(3)]


def test_strain_and_stress_of_a_pull_that_keeps_the_volume_and_of_swelling(bodies, turned):
    """The linear strain is that of lengths 1 + p along z.

    The von Mises value depends on differences of principal values. The stress is that of the neo-Hookean law:
    m (1 - 1 / (I + 1)) times that of squared stretches.
    """
    cube = bodies[0]
    long, thin = 1.21, 1 / np.sqrt(1.21)
    put(cube, (cube.mesh.vertices * [thin, thin, long]) @ turned.T)
    pulled = (long**2 - 1) / 2 - (thin**2 - 1) / 2
    mu = 1e5 / (2 * 1.2)
    for strain, stress in (
        (cube.tet_strain(), cube.tet_stress()),
        (cube.vertex_strain(), cube.vertex_stress()),
    ):
        np.testing.assert_allclose(strain, pulled * 2 / 3, rtol=1e-5)
        invariant = long**2 + 2 * thin**2
        modulus = 4 / 3 * mu * (1 - 1 / (invariant + 1))
        np.testing.assert_allclose(stress, modulus * 2 * pulled, rtol=1e-5)
    assert cube.tet_strain().shape == (40,)
    assert cube.vertex_strain().shape == (27,)
    put(cube, 1.3 * cube.mesh.vertices)
    np.testing.assert_allclose(cube.tet_strain(), 0, atol=1e-6)
    np.testing.assert_allclose(cube.vertex_stress(), 0, atol=0.1)


def test_a_vertex_has_the_mean_of_its_tetrahedra_by_volume(bodies):
    cube = bodies[0]
    put(cube, cube.mesh.vertices + RANDOM.normal(0, 0.05, cube.mesh.vertices.shape))
    strain, volumes = cube.tet_strain(), cube.mesh.volumes
    for vertex in range(27):
        round_ = (cube.tets == vertex).any(axis=1)
        expected = (strain * volumes)[round_].sum() / volumes[round_].sum()
        assert cube.vertex_strain()[vertex] == pytest.approx(expected)


def test_flipped_tetrahedra_are_named(bodies):
    cube = bodies[0]
    x = np.array(cube.mesh.vertices)
    put(cube, x)
    assert cube.flipped_tets().tolist() == []
    corner = int(np.argmax(x.sum(axis=1)))
    x[corner] = -x[corner]
    put(cube, x)
    assert cube.flipped_tets().tolist() == np.flatnonzero((cube.tets == corner).any(axis=1)).tolist()
    assert cube.flipped_count() == len(cube.flipped_tets())


def test_bodies_without_tetrahedra_have_no_strain(bodies):
    for body in bodies[1:]:
        for ask in (body.tet_strain, body.vertex_strain, body.tet_stress, body.vertex_stress):
            with pytest.raises(MeshError, match="no tetrahedra"):
                ask()
        assert body.flipped_tets().tolist() == []
