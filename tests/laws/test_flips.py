"""What a tetrahedron does that is turned inside out: through a face, an edge, a point, and as a whole body."""

import itertools

import numpy as np
import pytest

from taichi_soft import Material, TetMesh, internal_forces, sphere

STRAINS = ("linear", "exact")
MATERIAL = Material(young=1.0e5, poisson=0.2, density=1000.0, damping=0.0)
TET = TetMesh([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [(0, 1, 2, 3)])


def volume_gradient(x):
    """dV/dx of the four vertices, (4, 3)."""
    a, b, c = x[1] - x[0], x[2] - x[0], x[3] - x[0]
    rows = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)]) / 6.0
    return np.vstack([-rows.sum(axis=0), rows])


def through_a_face(depth):
    """The top vertex pushed through the opposite face."""
    x = TET.vertices.copy()
    x[3, 2] = -depth
    return x


def through_an_edge(depth):
    """One edge pushed past the opposite one."""
    x = TET.vertices.copy()
    shift = (x[[2, 3]].mean(axis=0) - x[[0, 1]].mean(axis=0)) * (1 + depth)
    x[[0, 1]] += shift
    return x


def through_a_point(depth):
    """Every vertex mirrored through the centre."""
    centre = TET.vertices.mean(axis=0)
    return centre - depth * (TET.vertices - centre)


POSES = [through_a_face, through_an_edge, through_a_point]
DEPTHS = (0.01, 0.3, 0.7, 1.0, 1.6)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("depth", DEPTHS)
def test_these_poses_are_flipped(pose, depth):
    x = pose(depth)
    assert np.linalg.det(x[1:] - x[0]) < 0


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("pose", POSES)
def test_tolerant_a_mirrored_tetrahedron_feels_the_mirrored_force(strain, pose):
    mirror = np.diag([1.0, 1.0, -1.0])
    for depth in DEPTHS:
        x = pose(depth)
        flipped = internal_forces(TET, MATERIAL, x, strain=strain, flips="tolerant")
        upright = internal_forces(TET, MATERIAL, x @ mirror, strain=strain, flips="tolerant")
        np.testing.assert_allclose(flipped, upright @ mirror, atol=1e-9 * max(np.abs(upright).max(), 1))


@pytest.mark.parametrize("strain", STRAINS)
def test_tolerant_a_whole_body_at_rest_in_its_mirror_stays_there(strain):
    ball = sphere(1.0, 2)
    for mirrored in (ball.vertices * (1, 1, -1), -ball.vertices):
        found = internal_forces(ball, MATERIAL, mirrored, strain=strain, flips="tolerant")
        assert np.abs(found).max() < 1e-5


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("depth", DEPTHS)
def test_recover_drives_every_flip_back_to_the_rest_shape(strain, pose, depth):
    """Going where the forces point, in short steps, ends upright and at rest."""
    x = pose(depth) + np.random.default_rng(1).normal(scale=1e-3, size=(4, 3))
    for step in np.geomspace(0.02, 1e-5, 1200):
        force = internal_forces(TET, MATERIAL, x, strain=strain, flips="recover")
        x = x + step * force / np.abs(force).max()
    assert np.linalg.det(x[1:] - x[0]) == pytest.approx(1.0, rel=1e-3)
    lengths = np.linalg.norm(x[:, None] - x, axis=-1)
    at_rest = np.linalg.norm(TET.vertices[:, None] - TET.vertices, axis=-1)
    np.testing.assert_allclose(lengths, at_rest, atol=1e-3)


@pytest.mark.parametrize("strain", STRAINS)
@pytest.mark.parametrize("pose", [through_a_face, through_an_edge])
def test_recover_is_continuous_through_flat(strain, pose):
    forces = [internal_forces(TET, MATERIAL, pose(d), strain=strain, flips="recover") for d in (-1e-7, 1e-7)]
    np.testing.assert_allclose(*forces, atol=1e-5 * np.abs(forces[0]).max())


@pytest.mark.parametrize("strain", STRAINS)
def test_tolerant_jumps_where_it_passes_through_flat(strain):
    above, below = (internal_forces(TET, MATERIAL, through_a_face(d), strain=strain) for d in (-1e-7, 1e-7))
    np.testing.assert_allclose(above[3], -below[3], atol=1e-3 * np.abs(above).max())
    assert np.abs(above[3]).max() > 1e3


def test_off_pushes_a_shallow_flip_back_and_lets_one_past_its_mirror_run_away():
    for depth, sign in ((0.3, 1.0), (1.6, -1.0)):
        x = through_a_face(depth)
        found = internal_forces(TET, MATERIAL, x, flips="off")
        assert sign * np.sum(found * volume_gradient(x)) > 0


@pytest.mark.parametrize(
    "options", list(itertools.product(("virial", "face"), STRAINS, ("tolerant", "recover", "off")))
)
def test_flat_and_collapsed_tetrahedra_have_finite_forces(options):
    law, strain, flips = options
    flat = TET.vertices * (1, 1, 0)
    line = TET.vertices * (1, 0, 0)
    for x in (flat, line, np.zeros((4, 3)), flat * 1e-12, TET.vertices * 1e-9, -TET.vertices * 1e-9):
        for dtype in (np.float64, np.float32):
            found = internal_forces(TET, MATERIAL, x, law=law, strain=strain, flips=flips, dtype=dtype)
            assert np.isfinite(found).all()


def test_upright_tetrahedra_do_not_know_how_flips_are_handled():
    x = TET.vertices + np.random.default_rng(0).normal(scale=0.1, size=(4, 3))
    for strain in STRAINS:
        a, b, c = (
            internal_forces(TET, MATERIAL, x, strain=strain, flips=f) for f in ("tolerant", "recover", "off")
        )
        np.testing.assert_allclose(a, b, atol=1e-12 * np.abs(a).max())
        np.testing.assert_allclose(a, c, atol=1e-12 * np.abs(a).max())
