"""Angles between edges and the normals that CMPM and its variants take for them (thesis fig. 4.7)."""

import bond_oracle as oracle
import numpy as np
import pytest

from taichi_soft import MeshError, OptionError, TetMesh, box, load_mesh, plane_angles, sphere
from taichi_soft.core.package_data import ASSETS

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


def test_cheap_normals_stand_across_the_means_of_the_halves_of_a_ring():
    """Section 4.4.2; the ring in its order round the edge, from the vertex of the lowest number on."""
    cheap, x = plane_angles(BALL, "best_fitting_plane", is_split=True), BALL.vertices
    for e, (p, q) in enumerate(BALL.edges.tolist()):
        around = np.array(sorted(oracle.neighbours(BALL, p, q)))
        axis = oracle.unit(x[q] - x[p])
        arms = x[around] - x[p] - np.outer((x[around] - x[p]) @ axis, axis)
        turn = np.arctan2(np.cross(arms[0], arms) @ axis, arms @ arms[0]) % (2 * np.pi)
        points = x[around[np.argsort(turn)]]
        if len(points) == 2:
            points = np.vstack([points, (x[p] + x[q]) / 2])
        half, spans = len(points) // 2, []
        for shift in (0, max(1, round(len(points) / 4))):
            turned = np.roll(points, -shift, axis=0)
            spans.append(turned[:half].mean(axis=0) - turned[half:].mean(axis=0))
        normal = np.cross(*spans)
        expected = angle_to(normal * np.sign(normal @ axis), p, q)
        assert cheap[e] == pytest.approx(expected, abs=1e-5)


def test_cheap_normals_are_those_of_the_fitted_planes_where_particles_lie_in_one():
    few = [e for e, (p, q) in enumerate(BALL.edges.tolist()) if len(oracle.neighbours(BALL, p, q)) <= 3]
    cheap, fitted = (plane_angles(BALL, "best_fitting_plane", is_split=split) for split in (True, False))
    assert len(few) > 5
    np.testing.assert_allclose(cheap[few], fitted[few], atol=1e-4)
    even = plane_angles(edge_in_even_ring(6), "best_fitting_plane", is_split=True)
    assert even[0] < 1e-5


def edge_in_even_ring(count):
    """An edge along z between vertices 0 and 1, and vertices evenly round its middle."""
    turn = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    tets = [[0, 1, 2 + i, 2 + (i + 1) % count] for i in range(count)]
    return TetMesh(np.vstack([[[0, 0, -0.5], [0, 0, 0.5]], ring]), tets, fix_orientation=True)


def test_cheap_normals_of_the_beam_with_a_hole_are_as_far_from_perpendicular_as_fitted_ones():
    """What 4.4.2 asks for: in the middle the two differ by less than 2 degrees."""
    mesh = load_mesh(ASSETS / "beam_with_hole.npz")
    cheap, fitted = (plane_angles(mesh, "best_fitting_plane", is_split=split) for split in (True, False))
    assert abs(np.median(cheap) - np.median(fitted)) < 2
    assert (cheap > 30).mean() > 0.1


@pytest.mark.parametrize(
    ("law", "is_split", "said"),
    [
        ("cmpm2", True, "leave out is_split"),
        ("best_fitting_plane", 1, "is_split must be True or False"),
    ],
)
def test_only_fitted_planes_are_split(law, is_split, said):
    with pytest.raises(OptionError, match=said):
        plane_angles(BALL, law, is_split=is_split)


def test_many_fitted_planes_of_the_beam_with_a_hole_are_far_from_perpendicular():
    """Fig. 4.7, on a mesh like the thesis's: more than the subfaces of 4.4.1 are."""
    mesh = load_mesh(ASSETS / "beam_with_hole.npz")
    fitted, subfaces = plane_angles(mesh, "best_fitting_plane"), plane_angles(mesh, "cmpm2")
    assert np.median(fitted) > np.median(subfaces)
    assert (fitted > 30).mean() > 0.1


@pytest.mark.parametrize("law", ["virial", "springs", "volume_springs", "plane", None])
def test_laws_without_planes_are_refused(law):
    with pytest.raises(OptionError, match="has no planes: choose one of 'cmpm', 'cmpm2'"):
        plane_angles(BALL, law)


def test_what_is_no_mesh_is_refused():
    with pytest.raises(MeshError, match="must be a TetMesh"):
        plane_angles("ball", "cmpm2")
