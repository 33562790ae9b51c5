"""Vertices split at sharp edges: the number of copies of each vertex, and the triangles of each copy."""

import numpy as np
import pytest

from taichi_soft.meshing import box, cloth, sphere
from taichi_soft.meshing.creases import split_at_creases

pytestmark = pytest.mark.numpy

# Four faces of a straight prism: it bends by 90 degrees along its edges, and by nothing across the diagonals.
TENT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1]], dtype=float)
ROOF = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]])[:, ::-1]


def folded(degrees):
    """Two triangles that share an edge and bend there by so much."""
    angle = np.radians(degrees)
    points = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(angle), 0, -np.sin(angle)]])
    return points, np.array([[0, 1, 2], [1, 0, 3]])


def test_a_cube_has_three_copies_of_each_corner_or_one():
    mesh = box((1, 1, 1), (1, 1, 1))
    vertices, triangles = split_at_creases(mesh.vertices, mesh.surface, 30.0)
    assert np.bincount(vertices).tolist() == [3] * 8
    np.testing.assert_array_equal(vertices[triangles], mesh.surface)
    vertices, triangles = split_at_creases(mesh.vertices, mesh.surface, None)
    assert vertices.tolist() == list(range(8))
    np.testing.assert_array_equal(triangles, mesh.surface)


def test_triangles_of_one_plane_share_their_vertices_at_any_angle():
    vertices, _ = split_at_creases(TENT, ROOF, 0.0)
    assert np.bincount(vertices).tolist() == [2, 2, 1, 1, 1, 1]


@pytest.mark.parametrize("degrees", [0.0, 20.0, 60.0, 90.0, 150.0, 180.0])
def test_an_edge_is_sharp_where_it_bends_by_more_than_the_crease(degrees):
    points, triangles = folded(degrees)
    assert len(split_at_creases(points, triangles, degrees)[0]) == 4
    assert len(split_at_creases(points, triangles, min(degrees + 0.1, 180.0))[0]) == 4
    if degrees > 0.0:
        assert len(split_at_creases(points, triangles, degrees - 0.1)[0]) == 6
    assert len(split_at_creases(points, triangles, None)[0]) == 4


@pytest.mark.parametrize("crease", [None, 60.0])
def test_each_side_of_a_sheet_has_its_own_copies_and_is_smooth(crease):
    """One cloth has all triangles of one side first, the other has them in alternation."""
    mesh = cloth(size=(1.0, 1.0), cells=(3, 3), mass=0.1)
    count = len(mesh.surface) // 2
    mixed = mesh.surface.reshape(2, count, 3).swapaxes(0, 1).reshape(-1, 3)
    for surface in (mesh.surface, mixed):
        vertices, triangles = split_at_creases(mesh.vertices, surface, crease)
        assert np.bincount(vertices).tolist() == [2] * len(mesh.vertices)
        np.testing.assert_array_equal(vertices[triangles], surface)
        up = (
            np.cross(*(mesh.vertices[surface[:, i]] - mesh.vertices[surface[:, 0]] for i in (1, 2)))[:, 2] > 0
        )
        assert not set(triangles[up].ravel()) & set(triangles[~up].ravel())


def test_parts_that_meet_in_a_vertex_only_share_none():
    points = np.concatenate([TENT, -TENT[1:]])
    other = np.where(ROOF == 0, 0, ROOF + 5)[:, ::-1]
    vertices, _ = split_at_creases(points, np.concatenate([ROOF, other]), None)
    assert (vertices == 0).sum() == 2


def test_vertices_of_no_triangle_are_left_out():
    mesh = sphere(1.0, 4)
    vertices, triangles = split_at_creases(mesh.vertices, mesh.surface, 60.0)
    np.testing.assert_array_equal(vertices, np.unique(mesh.surface))
    np.testing.assert_array_equal(vertices[triangles], mesh.surface)


def test_a_triangle_without_area_bends_nothing():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 0.5, 0]], dtype=float)
    triangles = np.array([[0, 1, 2], [2, 1, 4], [1, 3, 4], [4, 3, 2]])
    assert split_at_creases(points, triangles, 0.0)[0].tolist() == [0, 1, 2, 3, 4]
