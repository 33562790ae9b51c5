"""Surfaces read as their artist made them: order, axes, parts, texture; and what is no surface."""

import logging

import numpy as np
import pytest
import trimesh

from taichi_soft import MeshError, OptionError
from taichi_soft.meshing.surfaces import read_surfaces


def textured():
    """A box of single triangles, whose corners have texture coordinates of their own."""
    mesh = trimesh.creation.box((1.0, 2.0, 3.0))
    mesh.unmerge_vertices()
    uv = np.random.default_rng(0).random((len(mesh.vertices), 2))
    return trimesh.Trimesh(
        mesh.vertices, mesh.faces, process=False, visual=trimesh.visual.TextureVisuals(uv=uv)
    )


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl", "off"])
def test_a_file_comes_back_in_its_own_order(tmp_path, suffix):
    mesh = textured()
    mesh.export(tmp_path / f"crate.{suffix}")
    (found,) = read_surfaces(tmp_path / f"crate.{suffix}", up="z")
    np.testing.assert_allclose(found.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(found.triangles, mesh.faces)


def test_texture_coordinates_stay_with_their_vertices(tmp_path):
    mesh = textured()
    mesh.export(tmp_path / "crate.glb")
    (found,) = read_surfaces(tmp_path / "crate.glb")
    np.testing.assert_allclose(found.visual.uv, mesh.visual.uv, atol=1e-6)


def test_gltf_has_y_up_and_comes_back_with_z_up(tmp_path):
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "tall.glb")
    (found,) = read_surfaces(tmp_path / "tall.glb")
    assert np.ptp(found.vertices, axis=0) == pytest.approx([1.0, 3.0, 2.0])
    a, b, c = np.moveaxis(found.vertices[found.triangles], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(6.0)  # not mirrored
    (as_it_is,) = read_surfaces(tmp_path / "tall.glb", up="z")
    assert np.ptp(as_it_is.vertices, axis=0) == pytest.approx([1.0, 2.0, 3.0])


def test_a_scene_gives_all_its_meshes_where_they_stand():
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), node_name="left")
    scene.add_geometry(
        trimesh.creation.box(),
        node_name="right",
        transform=trimesh.transformations.translation_matrix((5, 0, 0)),
    )
    left, right = read_surfaces(scene)
    assert (left.name, right.name) == ("left", "right")
    assert right.vertices.mean(axis=0) - left.vertices.mean(axis=0) == pytest.approx([5, 0, 0])


def test_normals_point_outwards_and_have_unit_length():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    (found,) = read_surfaces((mesh.vertices, mesh.faces))
    np.testing.assert_allclose(found.normals, mesh.vertices, atol=0.02)
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0)


def test_normals_at_a_cubes_corners_lie_on_its_diagonals_however_its_faces_are_cut():
    """By angles: by areas the corners with more triangles of a face would lean to it. A triangle without area
    counts for nothing."""
    cube = trimesh.creation.box((2, 2, 2))
    (found,) = read_surfaces((cube.vertices, np.concatenate([cube.faces, [[0, 0, 1], [3, 4, 3]]])))
    np.testing.assert_allclose(found.normals, cube.vertices / np.sqrt(3), atol=1e-12)


def test_normals_without_scipy_are_made_in_silence(monkeypatch, caplog):
    def missing(*_, **__):
        raise ModuleNotFoundError("No module named 'scipy'")

    monkeypatch.setattr(trimesh.geometry, "index_sparse", missing)
    cube = trimesh.creation.box((2, 2, 2))
    (found,) = read_surfaces(trimesh.Trimesh(cube.vertices, cube.faces, process=False))
    np.testing.assert_allclose(found.normals, cube.vertices / np.sqrt(3), atol=1e-12)
    assert caplog.text == ""
    assert not logging.getLogger("trimesh.util").disabled


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_normals_are_those_of_the_file_where_it_has_any(tmp_path, turn):
    """Of a ball cut into single triangles, whose own normals would be those of facets; where a node turns the
    mesh, they turn with it."""
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.unmerge_vertices()
    smooth = trimesh.Trimesh(ball.vertices, ball.faces, vertex_normals=ball.vertices, process=False)
    node = trimesh.transformations.rotation_matrix(turn, (1, 0, 0))
    scene = trimesh.Scene()
    scene.add_geometry(smooth, transform=node)
    (tmp_path / "ball.glb").write_bytes(scene.export(file_type="glb", include_normals=True))
    (found,) = read_surfaces(tmp_path / "ball.glb", up="z")
    np.testing.assert_allclose(found.normals, found.vertices, atol=1e-5)
    np.testing.assert_allclose(found.vertices, ball.vertices @ node[:3, :3].T, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("none.glb", None, "no such file"),
        ("cut.glb", b"glTF\x02\x00\x00\x00", "cannot be read"),
        ("words.obj", b"these are words", "no triangles|cannot be read"),
        ("empty.stl", b"", "cannot be read|no triangles"),
        ("duck.fbx", b"", "unknown surface format"),
    ],
)
def test_a_file_that_is_no_surface_is_refused_by_its_name(tmp_path, name, content, text):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError, match=f"^{name}: .*({text})"):
        read_surfaces(tmp_path / name)


@pytest.mark.parametrize(
    ("source", "error", "text"),
    [
        (42, MeshError, "path of a file"),
        (([[0, 0, 0]], np.zeros((0, 3), int)), MeshError, "empty"),
        (([[0, 0, np.nan]] * 3, [[0, 1, 2]]), MeshError, "finite"),
        (([[0, 0, 0]] * 3, [[0, 1, 7]]), MeshError, "7"),
        (trimesh.Scene(), MeshError, "no triangles"),
    ],
)
def test_an_object_that_is_no_surface_is_refused(source, error, text):
    with pytest.raises(error, match=text):
        read_surfaces(source)


def test_an_unknown_axis_is_refused():
    with pytest.raises(OptionError, match="up must be"):
        read_surfaces(trimesh.creation.box(), up="x")
