"""What is drawn: inner vertices, sharp edges, normals, refusals."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.errors import MeshError, OptionError
from taichi_soft.meshing import box, sphere
from taichi_soft.render import PALETTE, Surface, colormap, highlight
from taichi_soft.render.colors import to_linear, to_srgb
from taichi_soft.render.frame_arrays import SceneArrays
from taichi_soft.render.tube import SIDES, Tube


@pytest.fixture(scope="module", autouse=True)
def _taichi():
    init("cpu")


def area_weighted_normals(positions, triangles):
    sums = np.zeros_like(positions, dtype=float)
    for corners in triangles:
        a, b, c = positions[corners].astype(float)
        for corner in corners:
            sums[corner] += np.cross(b - a, c - a)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def test_inner_vertices_are_dropped_and_triangles_stay():
    mesh = sphere(radius=1.0, resolution=3)
    surface = Surface.of(mesh)
    assert len(surface.positions) == len(mesh.surface_vertices) < len(mesh.vertices)
    np.testing.assert_array_equal(
        surface.positions[surface.triangles], mesh.vertices[mesh.surface].astype(np.float32)
    )


def test_new_positions_reach_the_vertices_they_belong_to():
    mesh = sphere(radius=1.0, resolution=3)
    surface = Surface.of(mesh)
    moved = mesh.vertices * [1.0, 2.0, 3.0] + [4.0, 0.0, 0.0]
    surface.positions = moved
    np.testing.assert_array_equal(
        surface.positions[surface.triangles], moved[mesh.surface].astype(np.float32)
    )


def test_a_box_has_sharp_edges_and_a_ball_has_none():
    cube = box((1.0, 1.0, 1.0), (2, 2, 2))
    surface = Surface.of(cube)
    # 26 vertices on the surface: 8 corners count three times, 12 edge middles twice, 6 face middles once.
    assert len(surface.positions) == 8 * 3 + 12 * 2 + 6
    normals = SceneArrays.of([surface]).normals
    assert np.isclose(np.abs(normals).max(axis=1), 1.0).all()
    ball = sphere(radius=1.0, resolution=1)  # an icosahedron
    assert len(Surface.of(ball).positions) == 12


def test_normals_are_smooth_and_weighted_by_area():
    mesh = sphere(radius=0.7, resolution=4)
    squashed = mesh.vertices * [1.0, 1.3, 0.6]
    scene = SceneArrays.of([Surface(squashed, mesh.surface), Surface.of(mesh)])
    np.testing.assert_allclose(
        scene.normals, area_weighted_normals(scene.positions, scene.triangles), atol=2e-6
    )
    last = scene.positions[-1] / np.linalg.norm(scene.positions[-1])
    np.testing.assert_allclose(scene.normals[-1], last, atol=0.02)  # outward


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e8])
def test_positions_that_are_not_finite_are_refused_with_the_vertex(bad):
    mesh = sphere(radius=1.0, resolution=2)
    surface = Surface.of(mesh)
    before = surface.positions.copy()
    broken = mesh.vertices.copy()
    vertex = mesh.surface_vertices[5]
    broken[vertex, 1] = bad
    with pytest.raises(OptionError, match=f"vertex {vertex} "):
        surface.positions = broken
    np.testing.assert_array_equal(surface.positions, before)


def test_wrong_shapes_are_refused():
    mesh = sphere(radius=1.0, resolution=2)
    surface = Surface.of(mesh)
    with pytest.raises(OptionError, match="positions must have shape"):
        surface.positions = mesh.vertices[:-1]
    with pytest.raises(OptionError, match="color"):
        surface.color = np.zeros((3, 3))
    with pytest.raises(OptionError, match="0 to 1"):
        surface.color = (255, 0, 0)
    with pytest.raises(OptionError, match="0 to 1"):
        surface.color = (0.5, np.nan, 0.5)
    with pytest.raises(MeshError, match="shape"):
        Surface(mesh.vertices, mesh.tets)
    with pytest.raises(MeshError, match="there are"):
        Surface(mesh.vertices[:5], mesh.surface)
    with pytest.raises(OptionError, match="finite"):
        Surface(mesh.vertices * np.nan, mesh.surface)


def test_colormap_runs_from_dark_to_bright_and_clamps():
    rgb = colormap(np.linspace(-1.0, 2.0, 61), 0.0, 1.0)
    light = to_linear(rgb) @ [0.2126, 0.7152, 0.0722]
    assert rgb.shape == (61, 3)
    np.testing.assert_array_equal(rgb[0], rgb[20])
    np.testing.assert_array_equal(rgb[40], rgb[60])
    assert (np.diff(light[20:41]) > 0.0).all()
    assert rgb[20, 2] > rgb[20, 1]  # violet, so red, green, blue are in this order
    with pytest.raises(OptionError):
        colormap([1.0, np.nan], 0.0, 1.0)
    with pytest.raises(OptionError, match="low must be below high"):
        colormap([1.0], 1.0, 1.0)


def test_highlight_marks_the_flagged():
    colors = highlight(np.array([False, True]), PALETTE[1], (1.0, 0.0, 0.0))
    np.testing.assert_allclose(colors, [PALETTE[1], (1.0, 0.0, 0.0)])
    with pytest.raises(OptionError):
        highlight([0, 1], PALETTE[0])


def test_srgb_round_trip():
    values = np.linspace(0.0, 1.0, 257, dtype=np.float32)
    np.testing.assert_allclose(to_srgb(to_linear(values)), values, atol=1e-6)
    assert to_linear(np.float32([0.5]))[0] == pytest.approx(0.21404, abs=1e-4)


def test_a_tube_around_a_bent_rope_is_closed_and_as_far_from_its_axis_as_its_radius():
    turn = np.linspace(0.0, 4.0, 9)
    axis = np.stack([np.cos(turn), np.sin(turn), 0.2 * turn], axis=1)
    edges = np.stack([np.arange(8), np.arange(1, 9)], axis=1)
    tube = Tube(axis, edges, 0.05)
    prisms = tube.spread(axis).reshape(8, 2, SIDES, 3)
    for (a, b), ends in zip(edges, prisms, strict=True):
        along = (axis[b] - axis[a]) / np.linalg.norm(axis[b] - axis[a])
        beside = ends.reshape(-1, 3) - axis[a]
        np.testing.assert_allclose(np.linalg.norm(np.cross(beside, along), axis=1), 0.05, rtol=1e-9)
    for before, after in zip(prisms[:-1, 1], prisms[1:, 0], strict=True):
        normal = np.cross(before[1] - before[0], before[2] - before[0])
        np.testing.assert_allclose((after - before[0]) @ normal, 0.0, atol=1e-9)  # one section for both
    x = tube.positions[tube.triangles].astype(float)
    volume = np.einsum("fi,fi->f", x[:, 0], np.cross(x[:, 1], x[:, 2])).sum() / 6.0
    length = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    section = 0.5 * SIDES * np.sin(2.0 * np.pi / SIDES) * 0.05**2
    assert volume == pytest.approx(section * length, rel=0.01)
    tube.color = np.linspace(0.0, 1.0, 27).reshape(9, 3)
    assert len(tube.color) == len(tube.positions)
