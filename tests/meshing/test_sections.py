"""Sections of tetrahedra with a plane, compared with polygons in NumPy, and on whole bodies."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taichi_soft import box, sphere
from taichi_soft.meshing.sections import section_areas

pytestmark = pytest.mark.numpy


def polygon_area(corners):
    """Return the area of the section of one tetrahedron (4, 3) with z = 0.

    The polygon's corners are the intersections of the edges with the plane, sorted around their centre.
    """
    points = []
    for a, b in combinations(corners, 2):
        if (a[2] < 0) != (b[2] < 0):
            points.append((a + (b - a) * a[2] / (a[2] - b[2]))[:2])
    if not points:
        return 0.0
    points = np.array(points)
    arms = points - points.mean(axis=0)
    x, y = points[np.argsort(np.arctan2(arms[:, 1], arms[:, 0]))].T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


@given(seed=st.integers(0, 2**32 - 1))
def test_a_section_is_the_polygon_between_the_edges_that_cross_the_plane(seed):
    corners = np.random.default_rng(seed).normal(size=(20, 4, 3))
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    found = section_areas(corners[:, :, 2], volumes)
    np.testing.assert_allclose(found, [polygon_area(tet) for tet in corners], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("height", [0.0, 0.2, 0.25, 0.5, 0.9])
def test_sections_of_a_block_make_its_cross_section_also_where_its_layers_meet(height):
    mesh = box((2.0, 3.0, 1.0), (2, 3, 4))
    heights = mesh.vertices[mesh.tets][:, :, 2] - mesh.bounds[0, 2] - height
    assert section_areas(heights, mesh.volumes).sum() == pytest.approx(6.0)


def test_beyond_a_body_there_is_no_section_and_through_a_ball_nearly_a_disc():
    mesh = sphere(1.0, 6)
    z = mesh.vertices[mesh.tets][:, :, 2]
    assert section_areas(z - 2.0, mesh.volumes).sum() == 0.0
    assert section_areas(z, mesh.volumes).sum() == pytest.approx(np.pi, rel=0.05)


def test_a_flat_tetrahedron_has_no_section():
    assert section_areas(np.zeros((1, 4)), np.zeros(1)).tolist() == [0.0]
    assert section_areas(np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([1 / 6])).tolist() == [0.5]
