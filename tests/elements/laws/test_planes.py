"""Angles between edges and the normals that CMPM and its variants take for them (thesis fig. 4.7)."""

import bond_oracle as oracle
import numpy as np
import pytest

from taichi_soft import MeshError, OptionError, box, load_mesh, plane_angles, sphere
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
