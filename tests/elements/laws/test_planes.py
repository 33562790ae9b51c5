"""Angles between edges and the normals that CMPM and its variants use (thesis fig. 4.7)."""

import bond_oracle as oracle
import numpy as np
import pytest

from taichi_soft import MeshError, OptionError, TetMesh, box, load_mesh, plane_angles, sphere
from taichi_soft.core.package_data import ASSETS

pytestmark = pytest.mark.kernel

BALL = sphere(0.7, 1)


def angle_to(normal, p, q):
    edge = oracle.unit(BALL.vertices[q] - BALL.vertices[p])
    return np.degrees(np.arccos(np.clip(oracle.unit(normal) @ edge, -1, 1)))


@pytest.mark.parametrize("law", ["cmpm", "tilted_plane"])
def test_voronoi_faces_and_tilted_planes_are_perpendicular(law):
    assert np.nanmax(plane_angles(BALL, law)) < 1e-5


def test_edges_whose_face_is_clipped_away_have_no_angle():
    """The diagonals of a lattice."""
    assert np.isnan(plane_angles(box((1, 1, 1), (2, 2, 2)), "cmpm")).sum() > 10


def test_subfaces_and_fitted_planes_stand_as_numpy_says():
    subfaces, fitted = plane_angles(BALL, "cmpm2"), plane_angles(BALL, "best_fitting_plane")
    x = BALL.vertices
    for e, (p, q) in enumerate(BALL.edges.tolist()):
        ring = oracle.tets_round(BALL, p, q)
        total = sum(oracle.quadrilateral(x, p, q, a, b) for _, a, b in ring)
        assert subfaces[e] == pytest.approx(angle_to(total, p, q), abs=1e-5)
        around = oracle.neighbours(BALL, p, q)
        points = x[around] if len(around) > 2 else np.vstack([x[around], (x[p] + x[q]) / 2])
        flat = np.linalg.svd(points - points.mean(axis=0))[1]
        if flat[1] - flat[2] > 1e-6:  # else any plane through the points fits as well
            normal = oracle.fitted_normal(points, x[q] - x[p])
            assert fitted[e] == pytest.approx(angle_to(normal, p, q), abs=1e-4)


def test_split_rings_have_the_normals_that_numpy_finds():
    split = plane_angles(BALL, "split_ring_plane")
    for e, (p, q) in enumerate(BALL.edges.tolist()):
        expected = angle_to(oracle.split_normal(BALL, p, q, BALL.vertices), p, q)
        assert split[e] == pytest.approx(expected, abs=1e-5)


def test_cheap_normals_are_those_of_the_fitted_planes_where_particles_lie_in_one():
    few = [e for e, (p, q) in enumerate(BALL.edges.tolist()) if len(oracle.neighbours(BALL, p, q)) <= 3]
    cheap, fitted = (plane_angles(BALL, law) for law in ("split_ring_plane", "best_fitting_plane"))
    assert len(few) > 5
    np.testing.assert_allclose(cheap[few], fitted[few], atol=1e-4)
    even = plane_angles(edge_in_even_ring(6), "split_ring_plane")
    assert even[0] < 1e-5


def edge_in_even_ring(count):
    """An edge along z between vertices 0 and 1, and vertices evenly round its middle."""
    turn = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    tets = [[0, 1, 2 + i, 2 + (i + 1) % count] for i in range(count)]
    return TetMesh(np.vstack([[[0, 0, -0.5], [0, 0, 0.5]], ring]), tets, fix_orientation=True)


def test_cheap_normals_of_the_beam_with_a_hole_are_as_far_from_perpendicular_as_fitted_ones():
    """By section 4.4.2, the cheap normals should be similar. The medians differ by less than 2 degrees."""
    mesh = load_mesh(ASSETS / "beam_with_hole.npz")
    cheap, fitted = (plane_angles(mesh, law) for law in ("split_ring_plane", "best_fitting_plane"))
    assert abs(np.median(cheap) - np.median(fitted)) < 2
    assert (cheap > 30).mean() > 0.1


def test_a_ring_whose_halves_lie_in_one_line_is_refused():
    """The fifth of six particles goes outwards to where the vectors of both splits are parallel."""

    def at(angle, radius):
        return radius * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])

    places = zip((0, 140, 155, 225, 255, 270), (0.2, 1.9, 0.3, 0.8, 1.0, 1.7), strict=True)
    ring = [at(angle, radius) for angle, radius in places]
    line, others = ring[2] - ring[5], ring[0] + ring[1] - ring[3]  # parallel, once ring[4] is taken off these
    mesh = edge_in_even_ring(6)
    for stretch in (1.0, np.cross(line, others)[2] / np.cross(line, ring[4])[2]):
        points = np.vstack([mesh.vertices[:2], ring[:4], [stretch * ring[4]], ring[5:]])
        bent = TetMesh(points, mesh.tets, fix_orientation=True)
        if stretch == 1.0:
            assert np.isfinite(plane_angles(bent, "split_ring_plane")).all()
        else:
            with pytest.raises(MeshError, match=r"edge 0 .*law='best_fitting_plane'"):
                plane_angles(bent, "split_ring_plane")


def test_many_fitted_planes_of_the_beam_with_a_hole_are_far_from_perpendicular():
    """Fig. 4.7, on a mesh like the thesis's: more than the subfaces of 4.4.1 are."""
    mesh = load_mesh(ASSETS / "beam_with_hole.npz")
    fitted, subfaces = plane_angles(mesh, "best_fitting_plane"), plane_angles(mesh, "cmpm2")
    assert np.median(fitted) > np.median(subfaces)
    assert (fitted > 30).mean() > 0.1


@pytest.mark.parametrize("law", ["virial", "springs", "volume_springs", "plane", None])
def test_laws_without_planes_are_refused(law):
    with pytest.raises(OptionError, match=r"planes.*'cmpm', 'cmpm2'"):
        plane_angles(BALL, law)


def test_what_is_no_mesh_is_refused():
    with pytest.raises(MeshError, match="must be a TetMesh"):
        plane_angles("ball", "cmpm2")
