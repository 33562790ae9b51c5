"""Meshes of shells: what they derive, and what they refuse."""

import copy

import numpy as np
import pytest
import trimesh

from taichi_soft import MeshError, OptionError, ShellMesh, sheet

pytestmark = pytest.mark.numpy

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
HALVES = [(0, 1, 2), (0, 2, 3)]


def test_a_mesh_derives_edges_areas_and_both_sides():
    mesh = ShellMesh(SQUARE, HALVES)
    assert mesh.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    assert mesh.areas.tolist() == [0.5, 0.5]
    assert mesh.surface.tolist() == [[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]]
    assert mesh.tets.shape == (0, 4)
    assert mesh.scaled(2.0).areas.tolist() == [2.0, 2.0]
    same = copy.deepcopy(mesh)
    assert np.array_equal(same.triangles, mesh.triangles)
    assert not same.triangles.flags.writeable
    with pytest.raises(AttributeError, match="immutable"):
        mesh.areas = 1


def test_a_sheet_is_centred_and_has_two_triangles_for_each_cell():
    mesh = sheet((2.0, 1.0), (4, 3))
    assert mesh.bounds.tolist() == [[-1.0, -0.5, 0.0], [1.0, 0.5, 0.0]]
    assert len(mesh.triangles) == 24
    assert mesh.areas.sum() == pytest.approx(2.0)
    assert mesh.vertices[4 * 1 + 2].tolist() == pytest.approx([-0.5, 0.5 - 1 / 3, 0.0])


def test_an_artists_surface_becomes_one_shell_without_seams(tmp_path):
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 0, 0), (1, 1, 0), (0, 1, 0), (5, 5, 5)]
    triangles = [(0, 1, 2), (3, 4, 5), (0, 0, 1), (2, 1, 0)]
    mesh = ShellMesh.from_surface((corners, triangles))
    assert len(mesh.vertices) == 4
    assert len(mesh.triangles) == 2
    path = tmp_path / "cape.obj"
    trimesh.Trimesh(np.array(SQUARE, float), HALVES, process=False).export(path)
    assert ShellMesh.from_surface(path, up="z", scale=0.5).areas.sum() == pytest.approx(0.25)
    assert ShellMesh.from_surface(path).bounds[1, 2] == pytest.approx(1.0)  # y is up in .obj files


@pytest.mark.parametrize(
    ("vertices", "triangles", "message"),
    [
        (SQUARE, [], "triangles is empty"),
        (SQUARE, [(0, 1, 2.5)], "integer"),
        (SQUARE, [(0, 1, 4)], "there are 4"),
        (SQUARE, [(0, 1, 1)], "names a vertex twice"),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], "triangle 0 has no area"),
        ([(0, 0, np.nan), (1, 0, 0), (1, 1, 0)], [(0, 1, 2)], "finite"),
        (SQUARE, [*HALVES, (2, 1, 0)], "belongs to 3 triangles|same vertices"),
        (SQUARE, [(0, 1, 2), (2, 1, 0)], "triangles 0 and 1 have the same vertices"),
        ([*SQUARE, (0, 0, 1)], [*HALVES, (0, 2, 4)], "the edge of vertices 0, 2 belongs to 3 triangles"),
        ([*SQUARE, (0, 0, 1)], HALVES, "vertex 4 belongs to no triangle"),
    ],
)
def test_a_mesh_that_is_no_shell_is_refused(vertices, triangles, message):
    with pytest.raises(MeshError, match=message):
        ShellMesh(vertices, triangles)


def test_a_sheet_of_a_wrong_size_is_refused():
    with pytest.raises(OptionError, match="size must be a number above 0 m, got 0"):
        sheet((1, 0), (2, 2))
    with pytest.raises(OptionError, match="cells must be a whole number"):
        sheet((1, 1), (2, 0))
