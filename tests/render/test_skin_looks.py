"""Colours of an artist's mesh: from its texture, its material, its vertices, or the caller's."""

import numpy as np
import pytest
import trimesh

from taichi_soft.render.skin_colors import vertex_colors

PIL = pytest.importorskip("PIL.Image")
OTHERWISE = (0.2, 0.4, 0.6)


def test_a_texture_is_looked_up_from_its_lower_left():
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255,) * 3
    uv = [(0.1, 0.9), (0.9, 0.9), (0.1, 0.1), (0.9, 0.1), (1.1, -0.1)]  # the last repeats
    visual = trimesh.visual.TextureVisuals(uv=uv, image=PIL.fromarray(pixels))
    found = vertex_colors(visual, 5, OTHERWISE)
    np.testing.assert_allclose(found, [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (1, 0, 0)])


def test_a_material_without_texture_gives_its_own_colour():
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 255, 0, 255])
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((3, 2)), material=material)
    np.testing.assert_allclose(vertex_colors(visual, 3, OTHERWISE), [(0, 1, 0)] * 3)


def test_vertices_keep_their_own_colours():
    mesh = trimesh.creation.box()
    mesh.visual.vertex_colors = np.tile([0, 0, 255, 255], (8, 1)).astype(np.uint8)
    np.testing.assert_allclose(vertex_colors(mesh.visual, 8, OTHERWISE), [(0, 0, 1)] * 8)


@pytest.mark.parametrize("visual", [None, trimesh.creation.box().visual, trimesh.visual.TextureVisuals()])
def test_where_nothing_is_said_the_callers_colour_is_taken(visual):
    np.testing.assert_allclose(vertex_colors(visual, 4, OTHERWISE), [OTHERWISE] * 4, rtol=1e-6)
