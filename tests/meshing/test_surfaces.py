"""Surfaces from files: order, axes, parts and texture are preserved, and other contents are refused."""

import logging
import re
import subprocess
import sys
import textwrap

import numpy as np
import pytest
import trimesh

from taichi_soft import MeshError, OptionError
from taichi_soft.meshing.surfaces import assumed_up, read_surfaces

pytestmark = pytest.mark.numpy


def textured():
    """Make a box of separate triangles, whose corners have their own texture coordinates."""
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
    """Normals are weighted by angles. Weights by area would favour a face with more triangles.

    A triangle without area has no weight.
    """
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
    """The ball consists of separate triangles, whose computed normals would be those of facets.

    If a node rotates the mesh, the normals rotate, too.
    """
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


def test_normals_that_point_away_from_all_their_triangles_are_computed_anew(tmp_path):
    """The file has reversed normals for a third of a ball's vertices.

    The other normals are kept, although they are tilted by 60 degrees.
    """
    ball = trimesh.creation.icosphere(subdivisions=3)
    given = ball.vertices.copy()
    is_turned = np.arange(len(given)) % 3 == 0
    given[is_turned] *= -1.0
    aside = np.cross(ball.vertices, [0.3, 0.5, 0.8])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    leaning = 0.5 * ball.vertices + np.sqrt(0.75) * aside
    given[~is_turned] = leaning[~is_turned]
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in ball.vertices]
    lines += [f"vn {x:.9f} {y:.9f} {z:.9f}" for x, y, z in given]
    lines += ["f " + " ".join(f"{i + 1}//{i + 1}" for i in face) for face in ball.faces]
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    (found,) = read_surfaces(tmp_path / "ball.obj", up="z")
    np.testing.assert_allclose(found.normals[is_turned], ball.vertices[is_turned], atol=0.02)
    np.testing.assert_allclose(found.normals[~is_turned], leaning[~is_turned], atol=1e-8)
    assert [note for note in found.notes if f"{is_turned.sum()} of its {len(given)} normals" in note]
    inside_out = trimesh.Trimesh(
        ball.vertices, ball.faces[:, ::-1], vertex_normals=ball.vertices, process=False
    )
    (found,) = read_surfaces(inside_out)
    np.testing.assert_allclose(found.normals, ball.vertices, atol=1e-12)
    assert "triangles face inwards" in found.notes[0]


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off"])
def test_the_axis_that_points_up_is_the_formats_unless_said(tmp_path, suffix):
    path = tmp_path / f"crate.{suffix}"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    heights = {up: np.ptp(read_surfaces(path, up)[0].vertices[:, 2]) for up in ("y", "z", None)}
    assumed = "y" if suffix == "obj" else "z"
    assert heights == {"y": pytest.approx(2.0), "z": pytest.approx(3.0), None: heights[assumed]}
    assert assumed_up(path).startswith(f"{assumed} is taken as up")
    assert f"up={'z' if assumed == 'y' else 'y'!r}" in assumed_up(path)


def test_no_axis_is_assumed_of_what_says_its_own():
    assert assumed_up("duck.glb") == assumed_up(trimesh.creation.box()) == assumed_up("x.npz") == ""


FAR = np.array([500_000.0, 4_649_776.0, 312.0])
"""As of UTM coordinates [m], where float32 is 0.5 m apart."""


def test_what_lies_far_away_is_moved_to_the_origin_before_anything_is_rounded(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    near = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in ball.vertices + FAR]
    faces = ["f " + " ".join(str(i + 1) for i in face) for face in ball.faces]
    (tmp_path / "far.obj").write_text("\n".join(near + faces))
    (found,) = read_surfaces(tmp_path / "far.obj", up="z", center=True, scale=2.0)
    np.testing.assert_allclose(found.vertices, 2.0 * ball.vertices, atol=1e-8)
    assert "(1000000, 9299552, 624) m" in found.notes[0]
    (left,) = read_surfaces(tmp_path / "far.obj", up="z")
    assert "0.5 m apart: center=True" in left.notes[0]
    assert read_surfaces((left,)) == (left,)
    parts = read_surfaces((ball, ball.copy().apply_translation((3.0, 0.0, 0.0))), center=True)
    assert [each.vertices.mean(axis=0).round(9).tolist() for each in parts] == [[-1.5, 0, 0], [1.5, 0, 0]]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"scale": 0.0}, "scale"),
        ({"scale": "mm"}, "scale"),
        ({"scale": np.nan}, "scale"),
        ({"center": 1}, "center"),
    ],
)
def test_a_place_or_a_size_that_is_none_is_refused(options, text):
    with pytest.raises(OptionError, match=text):
        read_surfaces(trimesh.creation.box(), **options)


def test_every_format_is_read_with_the_packages_of_the_core_alone(tmp_path):
    """A texture that needs pillow is omitted, with a note that names the extra."""
    for suffix in ("obj", "ply", "stl", "off", "glb"):
        trimesh.creation.box().export(tmp_path / f"plain.{suffix}")
    cut = (tmp_path / "plain.obj").read_text().splitlines()
    cut = ["mtllib x.mtl", "vt 0 0", "usemtl a", *(line.replace("f ", "f 1/1 ", 1) for line in cut)]
    (tmp_path / "textured.obj").write_text("\n".join(cut))
    (tmp_path / "x.mtl").write_text("newmtl a\nmap_Kd x.png\n")
    (tmp_path / "x.png").write_bytes(b"a picture")
    (tmp_path / "odd.stl").write_bytes(
        b"solid caf\xe9\nfacet outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet\n"
    )
    script = """
        import re, sys
        from importlib.metadata import packages_distributions, requires
        from pathlib import Path

        core, found = set(), ["taichi-soft", "taichi", "numpy", "trimesh"]
        while found:  # and what these need, without extras
            name = re.sub("[-_.]+", "-", found.pop()).lower()
            if name not in core:
                core.add(name)
                needed = requires(name) or [] if name != "taichi-soft" else []
                found += [re.match("[A-Za-z0-9._-]+", each)[0] for each in needed if ";" not in each]
        others = {
            module
            for module, owners in packages_distributions().items()
            if not {re.sub("[-_.]+", "-", owner).lower() for owner in owners} & core
        }

        class Missing:
            def find_spec(self, name, path=None, target=None):
                if name.partition(".")[0] in others:
                    raise ModuleNotFoundError(f"No module named {name!r}")

        sys.meta_path.insert(0, Missing())
        from taichi_soft.meshing.surfaces import read_surfaces
        for path in sorted(Path(sys.argv[1]).glob("*.*")):
            if path.suffix not in (".mtl", ".png"):
                for surface in read_surfaces(path):
                    print(path.name, len(surface.triangles), *surface.notes)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert [line.split()[0] for line in done.stdout.splitlines()] == sorted(
        path.name for path in tmp_path.glob("*.*") if path.suffix not in (".mtl", ".png")
    )
    assert re.search(r"texture x\.png .*pillow.*taichi-soft\[film\]", done.stdout)
    assert "taichi-soft[film]" in done.stdout


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("none.glb", None, "no such file"),
        ("cut.glb", b"glTF\x02\x00\x00\x00", "cannot be read"),
        ("words.obj", b"these are words", "no triangles|cannot be read"),
        ("empty.stl", b"", "cannot be read|no triangles"),
        ("duck.fbx", b"", "unknown surface format"),
        ("pointer.obj", b"version https://git-lfs.github.com/spec/v1\noid sha256:0", "git lfs pull"),
        ("page.stl", b"<!DOCTYPE html><html></html>", "web page"),
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
