"""The region that a surface encloses, compared with closed forms, despite defects of the triangles."""

import numpy as np
import pytest
import trimesh
from surfaces import ball, joined, lens_volume, turned, with_some_turned, with_triangles, without

from taichi_soft.cages.solid import solid_of
from taichi_soft.cages.voxels import volume_within

pytestmark = pytest.mark.numpy

BALL = ball()


def solid(mesh, voxels=64):
    vertices = np.asarray(mesh.vertices, dtype=float)
    return solid_of(vertices, np.asarray(mesh.faces), np.ptp(vertices, axis=0).max() / voxels)


SOUND = {
    "ball": (BALL, BALL.volume),
    "box": (trimesh.creation.box((1.0, 0.7, 0.4)), 0.28),
    "turned box": (turned(trimesh.creation.box((1.0, 0.7, 0.4))), 0.28),
    "sheet of a fifth of a voxel": (trimesh.creation.box((1.0, 1.0, 0.003)), 0.003),
    "turned sheet": (turned(trimesh.creation.box((1.0, 1.0, 0.003))), 0.003),
    "needle": (turned(trimesh.creation.box((1.0, 0.02, 0.02))), 0.0004),
    "torus": (turned(trimesh.creation.torus(1.0, 0.3)), trimesh.creation.torus(1.0, 0.3).volume),
}

FAULTY = {
    "inside out": (with_triangles(BALL, BALL.faces[:, ::-1]), BALL.volume),
    "every triangle twice": (joined(BALL, BALL), BALL.volume),
    "one in twenty turned round": (with_some_turned(BALL, 0.05), BALL.volume),
    "one in twenty missing": (without(BALL, 0.05), BALL.volume),
    "a ball in the ball, facing out": (joined(BALL, ball(0.5)), BALL.volume),
    "a cavity": (joined(BALL, with_triangles(ball(0.5), BALL.faces[:, ::-1])), BALL.volume * 7 / 8),
    "two that overlap": (joined(BALL, ball(at=(0.8, 0, 0))), 2 * 4.18879 - lens_volume(1.0, 0.8)),
    "a wall within": (joined(BALL, with_triangles(ball(0.9), [[0, 1, 2], [3, 4, 5]])), BALL.volume),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_closed_surface_holds_its_volume_and_centre(name):
    mesh, volume = SOUND[name]
    found = solid(mesh)
    points, volumes = found.quadrature()
    size = np.ptp(mesh.vertices, axis=0).max()
    assert found.volume == pytest.approx(volume, rel=0.03 if name == "needle" else 5e-3)
    assert volumes.sum() == pytest.approx(found.volume)
    np.testing.assert_allclose(volumes @ points / volumes.sum(), mesh.center_mass, atol=size / 128)
    assert found.open_fraction == 0.0


@pytest.mark.parametrize("name", FAULTY)
def test_what_is_wrong_with_triangles_changes_the_solid_little(name):
    mesh, volume = FAULTY[name]
    assert solid(mesh).volume == pytest.approx(volume, rel=0.02)


BRICK = trimesh.creation.box((1.0, 0.7, 0.4))


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (joined(BALL, BALL), BALL.volume),
        (turned(joined(BRICK, BRICK, BRICK)), 0.28),
        (turned(joined(BRICK, BRICK.subdivide())), 0.28),  # with other triangles
        (joined(BALL, ball(0.999)), BALL.volume),
        (turned(joined(BRICK, BRICK.copy().apply_translation((0.5, 0.0, 0.0)))), 0.42),
        (joined(*(with_triangles(BALL, BALL.faces[:, ::-1]) for _ in range(2))), BALL.volume),
    ],
    ids=["twice", "three times", "cut otherwise", "nearly twice", "overlapping", "twice inside out"],
)
def test_what_is_inside_of_several_parts_counts_once(mesh, volume):
    """The voxels are as coarse as those of ten cells, and therefore many lie at the surface."""
    assert solid(mesh, 40).volume == pytest.approx(volume, rel=5e-3)


def test_the_volume_is_the_same_far_from_the_origin():
    """At 5,000 km, cubes of coordinates have no digits left for a cubic metre."""
    away = np.array([500_000.0, 4_649_776.0, 312.0])
    assert volume_within(BALL.triangles + away) == pytest.approx(BALL.volume, rel=1e-6)


def test_second_moments_are_those_of_the_solid():
    """A ball of radius r and volume V has the second moment V r^2 / 5 about any axis through its centre."""
    points, volumes = solid(ball(subdivisions=5)).quadrature()
    second = np.einsum("k,ki,kj->ij", volumes, points, points)
    np.testing.assert_allclose(second, np.eye(3) * BALL.volume / 5, atol=0.012)


def test_the_surface_within_a_voxel_lies_on_the_ball():
    found = solid(ball(subdivisions=5))
    places = found.surface[np.isfinite(found.surface[..., 0])]
    assert len(places) > 10_000
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), 1.0, atol=2e-3)


def test_lines_through_a_sheet_do_not_come_back():
    sheet = with_triangles(turned(trimesh.creation.box((1.0, 1.0, 1.0))), [[0, 1, 2], [1, 3, 2]])
    assert solid(sheet).open_fraction == 1.0
    assert 0.0 < solid(without(BALL, 0.05)).open_fraction < 0.3
