"""Meshes that become solids, and meshes that are refused with a suggestion."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from taichi_soft import (
    MeshError,
    MeshShape,
    OptionError,
    SoftBodyAsset,
    load_mesh,
    preset,
    rope,
    sphere,
    torus,
)
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.kernel

CUBE = trimesh.creation.box((1, 1, 1))
COARSE = 0.1


def value_at(shape, place):
    """Return the sample at the node nearest to a position."""
    node = np.rint((np.array(place) - shape.parameters[:3]) / shape.cell).astype(int)
    return shape.samples.reshape(shape.resolution)[tuple(node)]


def box_at(size, place, inverted=False):
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(place)
    if inverted:
        mesh.invert()
    return mesh


def test_the_grid_holds_the_mesh_with_a_margin():
    mesh = box_at((1, 0.5, 2), (3, 0, -1))
    shape = MeshShape(mesh)
    low = shape.parameters[:3]
    high = low + shape.cell * (np.array(shape.resolution) - 1)
    assert shape.cell == pytest.approx(2 / 64)
    assert shape.parameters[3] == np.float32(shape.cell)
    assert (low <= mesh.bounds[0] - 2 * shape.cell + 1e-6).all()
    assert (high >= mesh.bounds[1] + 2 * shape.cell - 1e-6).all()
    assert len(shape.samples) == np.prod(shape.resolution)
    np.testing.assert_array_equal(shape.bounds, mesh.bounds)
    vertices, triangles = shape.surface()
    assert trimesh.Trimesh(vertices, triangles).volume == pytest.approx(1.0)


def test_a_soup_of_triangles_is_sewn_together():
    """Every triangle has its own vertices, as in .stl files. There is also a line between two of them."""
    soup = CUBE.triangles.reshape(-1, 3)
    triangles = np.arange(len(soup)).reshape(-1, 3)
    shape = MeshShape((np.vstack([soup, soup[:1]]), np.vstack([triangles, [[0, 1, len(soup)]]])), cell=COARSE)
    assert len(shape.vertices) == 8
    assert len(shape.triangles) == 12
    np.testing.assert_array_equal(shape.samples, MeshShape(CUBE, cell=COARSE).samples)


def test_a_tet_mesh_is_taken_by_its_surface():
    ball = sphere(0.5, 4)
    shape = MeshShape(ball, cell=COARSE)
    assert len(shape.triangles) == len(ball.surface)
    assert trimesh.Trimesh(*shape.surface()).volume == pytest.approx(ball.volume)
    assert value_at(shape, (0, 0, 0)) < -0.4


def test_parts_that_overlap_are_one_solid_and_a_shell_turned_inward_is_a_cavity():
    parts = [
        box_at((1, 1, 1), (0, 0, 0)),
        box_at((1, 1, 1), (0.7, 0, 0)),
        box_at((0.5,) * 3, (-0.1, 0, 0), True),
    ]
    shape = MeshShape(trimesh.util.concatenate(parts), cell=0.05)
    assert value_at(shape, (0.35, 0.4, 0.4)) < 0
    assert value_at(shape, (1.1, 0, 0)) < 0
    assert value_at(shape, (-0.1, 0, 0)) == pytest.approx(0.25, abs=0.05)
    assert value_at(shape, (1.25, 0, 0)) > 0


def test_shapes_stay_as_they_are():
    vertices = np.array(CUBE.vertices)
    shape = MeshShape((vertices, CUBE.faces), cell=COARSE)
    before = shape.samples.copy()
    vertices[:] = 0
    np.testing.assert_array_equal(shape.bounds, CUBE.bounds)
    for array in (shape.samples, shape.vertices, shape.triangles, shape.bounds, shape.parameters):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(AttributeError):
        shape.cell = 1.0
    np.testing.assert_array_equal(shape.samples, before)


def without(mesh, rows):
    return mesh.vertices, np.delete(mesh.faces, rows, axis=0)


def turned(mesh, rows):
    faces = mesh.faces.copy()
    faces[rows] = faces[rows][:, ::-1]
    return mesh.vertices, faces


def moved(mesh, row, place):
    vertices = np.array(mesh.vertices)
    vertices[row] = place
    return vertices, mesh.faces


REFUSED = {
    "open": (without(CUBE, [3]), "3 edges .*fill_holes"),
    "a sheet": (((0, 0, 0), (1, 0, 0), (0, 1, 0)), "got tuple"),
    "one triangle": ((np.eye(3), [[0, 1, 2]]), "open"),
    "neighbours that face opposite ways": (turned(CUBE, [3]), "fix_normals"),
    "inside out": (turned(CUBE, slice(None)), r"inside out \(volume -1 m\^3\).*mesh.invert"),
    "a part inside out": (
        trimesh.util.concatenate([CUBE, box_at((0.5,) * 3, (2, 0, 0), True)]),
        "part of the mesh is inside out.*fix_normals",
    ),
    "flat": ((np.eye(3), [[0, 1, 2], [0, 2, 1]]), "encloses no volume"),
    "a point": ((np.zeros((3, 3)), [[0, 1, 2]]), "encloses no volume"),
    "thin": (trimesh.creation.box((1, 1, 0.005)), "too thin for cell=0.0156.*cell=0.00781"),
    "thin and slanted": (
        trimesh.creation.box((1, 1, 0.005), trimesh.transformations.euler_matrix(0.2, 0.3, 0.1)),
        "too thin",
    ),
    "a thin-walled bottle": (trimesh.creation.annulus(0.49, 0.495, 1.0), "too thin"),
    "not finite": (moved(CUBE, 4, np.nan), "vertex 4"),
    "in micrometres": (CUBE.copy().apply_scale(1e7), "scale it to metres"),
    "indices out of range": ((CUBE.vertices[:7], CUBE.faces), "names vertices"),
    "a triangle with a vertex twice": ((np.eye(3), [[0, 1, 1]]), "twice"),
    "no triangles": ((np.eye(3), np.zeros((0, 3), int)), "empty"),
    "a rope": (rope(1.0, 4, 1.0), "got ParticleMesh"),
    "nothing": (None, "got NoneType"),
    "a name": ("bunny.stl", "got str"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_solid_is_refused_and_leaves_no_file(name, cache_folder):
    mesh, message = REFUSED[name]
    with pytest.raises(MeshError, match=message):
        MeshShape(mesh)
    assert not cache_folder.exists()


@pytest.mark.parametrize("cell", [0, -1, np.nan, np.inf, "1", (1, 1), 1e-12])
def test_cells_out_of_range(cell):
    with pytest.raises(OptionError, match="cell must be a length"):
        MeshShape(CUBE, cell=cell)


@pytest.mark.parametrize("size", [(1, 1, 1), (1, 0.01, 0.01)])
def test_a_cell_that_is_too_fine_is_refused_with_one_that_is_not(size):
    mesh = trimesh.creation.box(size)
    with pytest.raises(MeshError, match="2,000,000") as caught:
        MeshShape(mesh, cell=1e-4)
    offer = float(str(caught.value).split("use cell=")[1].split()[0])
    assert 1_500_000 < len(MeshShape(mesh, cell=offer).samples) <= 2_000_000


def test_a_thin_plate_is_taken_with_the_cells_it_needs():
    shape = MeshShape(trimesh.creation.box((1, 0.5, 0.02)), cell=0.01)
    assert shape.samples.min() == pytest.approx(-0.01, abs=1e-4)


@pytest.mark.parametrize("angle", [20, 45])
def test_a_ramp_is_taken_though_its_edge_is_sharp(angle):
    height = np.tan(np.radians(angle))
    corners = [[x, y, z] for y in (0, 0.7) for x, z in ((0, 0), (1, 0), (1, height))]
    ramp = trimesh.convex.convex_hull(np.array(corners))
    shape = MeshShape(ramp)
    assert value_at(shape, (0.8, 0.35, 0.1)) < 0


def test_cache_must_be_true_or_false():
    with pytest.raises(OptionError, match="cache must be"):
        MeshShape(CUBE, cache="yes")


@pytest.mark.soak
def test_one_thread_gives_the_same_bits_as_all():
    script = """
import sys
from taichi_soft import MeshShape, init, torus
init("cpu", threads=1)
sys.stdout.buffer.write(MeshShape(torus(0.8, 0.25), cell=0.04, cache=False).samples.tobytes())
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(__file__).parents[3], capture_output=True, timeout=120
    )
    assert done.stdout == MeshShape(torus(0.8, 0.25), cell=0.04, cache=False).samples.tobytes()


def test_the_way_to_a_body_that_a_refused_surface_names_runs_as_it_stands(tmp_path, monkeypatch):
    box_at((1, 1, 1), (0, 0, 0.5)).export(tmp_path / "wheel.stl")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MeshError) as caught:
        load_mesh("wheel.stl")
    (call,) = re.findall(r"(SoftBodyAsset\.from_surface\(.*?\))", str(caught.value))
    asset = eval(call, {"SoftBodyAsset": SoftBodyAsset, "material": preset("cork")})
    assert asset.description.masses.sum() == pytest.approx(preset("cork").density, rel=0.01)


@pytest.mark.parametrize("source", [CUBE, trimesh.Scene([CUBE])])
def test_a_surface_or_a_scene_in_the_place_of_a_body_is_told_the_way(source):
    way = r"got (Trimesh|Scene): SoftBodyAsset\.from_surface\(mesh, material\) makes a body from it"
    with pytest.raises(MeshError, match=way):
        bare_world().add_body(source, preset("cork"))
    with pytest.raises(MeshError, match=r"got int$"):
        bare_world().add_body(7, preset("cork"))


def test_a_scene_in_the_place_of_a_mesh_shape_is_told_the_way():
    with pytest.raises(MeshError, match=r'Scene.*trimesh\.load\(path, force="mesh"\)') as caught:
        MeshShape(trimesh.Scene([CUBE]))
    with pytest.raises(MeshError, match=r"got int$"):
        MeshShape(7)
    (call,) = re.findall(r"scene\.(.*)$", str(caught.value))
    joined = eval(f"trimesh.Scene([CUBE]).{call}")
    assert MeshShape(joined, cell=COARSE).bounds.tolist() == MeshShape(CUBE, cell=COARSE).bounds.tolist()


@pytest.mark.parametrize("installed", [False, True])
def test_ways_out_say_what_has_to_be_installed_for_them(monkeypatch, installed):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: "spec" if installed else None)
    notes = r" \(which needs {}, not installed here: pip install {}\)" if not installed else "{:.0}{:.0}"
    hole = re.escape("trimesh.repair.fill_holes(mesh)") + notes.format("networkx", "networkx") + ", or"
    with pytest.raises(MeshError, match=hole):
        MeshShape((CUBE.vertices, CUBE.faces[1:]))
    turned = CUBE.faces.copy()
    turned[0] = turned[0][::-1]
    with pytest.raises(
        MeshError, match=r"fix_normals\(\)" + notes.format("networkx and scipy", "networkx scipy") + "$"
    ):
        MeshShape((CUBE.vertices, turned))
