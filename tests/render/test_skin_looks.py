"""Looks of an artist's mesh: its texture, and colours from its material, its vertices, or the caller's."""

import numpy as np
import pytest
import trimesh

from taichi_soft.render.skin_looks import texture_picture, vertex_colors

PIL = pytest.importorskip("PIL.Image")
OTHERWISE = (0.2, 0.4, 0.6)
PICTURE = PIL.fromarray(np.zeros((2, 2, 3), np.uint8))


def test_a_texture_lies_on_what_has_a_place_on_it_for_each_vertex():
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((5, 2)), image=PICTURE)
    assert texture_picture(visual, 5) is not None
    assert texture_picture(visual, 4) is None
    assert texture_picture(trimesh.visual.TextureVisuals(image=PICTURE), 5) is None
    assert texture_picture(trimesh.creation.box().visual, 8) is None
    assert texture_picture(None, 8) is None


def test_a_texture_is_multiplied_by_the_factor_of_its_material_or_else_by_white():
    uv = np.zeros((3, 2))
    plain = trimesh.visual.TextureVisuals(uv=uv, image=PICTURE)
    np.testing.assert_allclose(vertex_colors(plain, 3, OTHERWISE), np.ones((3, 3)))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=PICTURE, baseColorFactor=[0, 255, 0, 255])
    tinted = trimesh.visual.TextureVisuals(uv=uv, material=material)
    np.testing.assert_allclose(vertex_colors(tinted, 3, OTHERWISE), [(0, 1, 0)] * 3)


def test_a_material_without_texture_gives_its_own_colour():
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 255, 0, 255])
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((3, 2)), material=material)
    np.testing.assert_allclose(vertex_colors(visual, 3, OTHERWISE), [(0, 1, 0)] * 3)


@pytest.mark.parametrize(("factor", "wanted"), [(None, (1, 0, 0.6)), ([0.5, 1, 0.5, 1], (0.5, 0, 0.3))])
@pytest.mark.parametrize("texture", [None, PICTURE])
def test_colours_of_vertices_are_multiplied_by_the_factor_of_their_material(factor, wanted, texture):
    """The glTF specification requires this product. A texture is multiplied by it."""
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=factor, baseColorTexture=texture)
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((3, 2)), material=material)
    visual.vertex_attributes["color"] = np.tile(np.array([255, 0, 153, 255], np.uint8), (3, 1))
    np.testing.assert_allclose(vertex_colors(visual, 3, OTHERWISE), [wanted] * 3, atol=3e-3)


def test_vertices_keep_their_own_colours():
    mesh = trimesh.creation.box()
    mesh.visual.vertex_colors = np.tile([0, 0, 255, 255], (8, 1)).astype(np.uint8)
    np.testing.assert_allclose(vertex_colors(mesh.visual, 8, OTHERWISE), [(0, 0, 1)] * 8)


@pytest.mark.parametrize("visual", [None, trimesh.creation.box().visual, trimesh.visual.TextureVisuals()])
def test_where_nothing_is_said_the_callers_colour_is_taken(visual):
    np.testing.assert_allclose(vertex_colors(visual, 4, OTHERWISE), [OTHERWISE] * 4, rtol=1e-6)
