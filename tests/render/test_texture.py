"""Textures: each pixel of a picture has the colour of the place of the texture that it sees."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.errors import OptionError
from taichi_soft.render import Camera, Renderer, Surface, Texture
from taichi_soft.render.colors import to_linear

SIZE = (200, 160)
CAMERA = Camera((0.6, -2.2, 0.9), (0.0, 0.0, 0.0))
CORNERS = np.array([(-0.7, 0.0, -0.5), (0.7, 0.0, -0.5), (0.7, 0.0, 0.5), (-0.7, 0.0, 0.5)])
TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)])
UV = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
DARK, BRIGHT = np.array([40, 90, 160]), np.array([230, 200, 70])
CHECKS = np.where((np.indices((4, 6)).sum(axis=0) % 2)[..., None], BRIGHT, DARK).astype(np.uint8)


@pytest.fixture(scope="module")
def renderer():
    init("cpu")
    return Renderer(*SIZE, camera=CAMERA, floor=None)


def quad(**looks):
    return Surface(CORNERS, TRIANGLES, normals=np.tile([0.0, -1.0, 0.0], (4, 1)), **looks)


def textured(pixels, uv=UV, color=(1.0, 1.0, 1.0)):
    return quad(texture=Texture(pixels), uv=uv, color=color)


def places():
    """Return the texture coordinates at the centre of each pixel, and True if the pixel shows only the quad.

    The coordinates are those where the pixel's ray meets the plane of the quad.
    """
    right, down, forward = CAMERA.axes
    focal = min(SIZE) / (2.0 * np.tan(np.radians(CAMERA.fov_degrees) / 2.0))
    u, v = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    x, y = (u - SIZE[0] / 2)[..., None] / focal, (v - SIZE[1] / 2)[..., None] / focal
    rays = forward + x * right + y * down
    points = np.array(CAMERA.eye) - (CAMERA.eye[1] / rays[..., 1])[..., None] * rays
    uv = (points[..., [0, 2]] + (0.7, 0.5)) / (1.4, 1.0)
    return uv, ((uv > 0.03) & (uv < 0.97)).all(axis=-1)


def light(picture):
    return to_linear(picture.astype(np.float32) / 255.0)


def lights_of_both(renderer):
    """Pictures of the quad in either colour of the checks, without a texture, as light."""
    return [light(renderer.render([quad(color=color / 255.0)])) for color in (DARK, BRIGHT)]


def test_a_pixel_has_the_colour_of_the_texel_that_it_sees(renderer):
    """The texture is a checkerboard. Between the centres of texels, colours are interpolated.

    The interpolation is computed here. The light on the quad is that of a quad in one colour.
    """
    uv, is_quad = places()
    dark, bright = lights_of_both(renderer)
    assert is_quad.sum() > 4000
    found = light(renderer.render([textured(CHECKS)]))
    x, y = uv[..., 0] * 6 - 0.5, (1.0 - uv[..., 1]) * 4 - 0.5
    i, j, fx, fy = np.floor(x).astype(int), np.floor(y).astype(int), x % 1.0, y % 1.0
    share = sum(
        wx * wy * (((i + di) % 6 + (j + dj) % 4) % 2)
        for di, wx in ((0, 1 - fx), (1, fx))
        for dj, wy in ((0, 1 - fy), (1, fy))
    )[..., None]
    expected = dark + share * (bright - dark)
    # A sample lies up to half a pixel beside the middle: a fortieth of a texel here.
    assert np.abs(found - expected)[is_quad].max() < 0.05
    assert np.abs(found - expected)[is_quad].mean() < 0.012
    assert np.abs(bright - dark)[is_quad].max() > 0.3


def test_a_texture_of_one_colour_looks_as_that_colour_and_is_multiplied_by_the_surfaces(renderer):
    _, is_quad = places()
    plain = np.tile(DARK, (5, 3, 1)).astype(np.uint8)
    found, other = renderer.render([textured(plain)]), renderer.render([quad(color=DARK / 255.0)])
    assert np.abs(found.astype(int) - other)[is_quad].max() <= 1
    red = light(renderer.render([textured(plain, color=(1.0, 0.0, 0.0))]))
    without = light(renderer.render([quad(color=(DARK[0] / 255.0, 0.0, 0.0))]))
    np.testing.assert_allclose(red[is_quad], without[is_quad], atol=0.01)


def test_it_repeats_beyond_its_edges(renderer):
    _, is_quad = places()
    one = renderer.render([textured(CHECKS)]).astype(int)
    other = renderer.render([textured(CHECKS, uv=np.add(UV, (3.0, -2.0)))]).astype(int)
    assert np.abs(one - other)[is_quad].max() <= 2


def test_checks_far_finer_than_pixels_are_seen_as_their_mean_light(renderer):
    _, is_quad = places()
    fine = np.where((np.indices((512, 512)).sum(axis=0) % 2)[..., None], BRIGHT, DARK).astype(np.uint8)
    dark, bright = lights_of_both(renderer)
    found = light(renderer.render([textured(fine)]))
    np.testing.assert_allclose(found[is_quad], ((dark + bright) / 2)[is_quad], atol=0.01)


def test_surfaces_side_by_side_keep_their_own_textures(renderer):
    """One surface is in front, one behind, one has no texture.

    Each pixel is as if its surface were drawn alone.
    """
    _, is_quad = places()
    ahead = textured(np.tile(BRIGHT, (2, 2, 1)).astype(np.uint8))
    alone = renderer.render([textured(CHECKS)])
    ahead.positions = np.add(CORNERS, (0.0, -9.0, 0.0))  # behind the camera
    plain = quad(color=(0.1, 0.9, 0.1))
    plain.positions = np.add(CORNERS, (0.0, 3.0, 0.0))  # hidden
    together = renderer.render([ahead, textured(CHECKS), plain])
    assert np.abs(alone.astype(int) - together)[is_quad].max() <= 1


@pytest.mark.parametrize(
    "pixels", [None, 3, np.zeros((4, 4)), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8), "red"]
)
def test_what_is_no_picture_is_refused(pixels):
    with pytest.raises(OptionError, match=r"pixels|texture"):
        Texture(pixels)


def test_a_texture_needs_a_place_for_each_vertex():
    with pytest.raises(OptionError, match="together"):
        quad(texture=Texture(CHECKS))
    with pytest.raises(OptionError, match="together"):
        quad(uv=UV)
    with pytest.raises(OptionError, match="uv"):
        quad(texture=Texture(CHECKS), uv=UV[:3])
    with pytest.raises(OptionError, match="Texture"):
        quad(texture=CHECKS, uv=UV)
