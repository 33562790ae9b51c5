"""Rubber, jelly and cloth: what each does with light, and that they keep their colours."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing import cloth, sphere
from taichi_soft.render import PALETTE, Camera, Look, Renderer, Surface
from taichi_soft.render.colors import to_linear

SIZE = (240, 160)
VIEW = Camera((0.0, -3.0, 1.0), (0.0, 0.0, 0.0))
BALL = sphere(radius=0.7, resolution=6)
SHEET = cloth((1.4, 1.4), (6, 6), 1.0)
HALF = len(SHEET.surface) // 2
FRONT = SHEET.surface[:HALF]
# In the x-z plane, its front to the camera.
UPRIGHT = SHEET.vertices @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture(scope="module", autouse=True)
def _taichi():
    init("cpu")


@pytest.fixture(scope="module")
def renderer():
    return Renderer(*SIZE, camera=VIEW, floor=None)


def light(picture):
    return to_linear(picture.astype(np.float32) / 255.0)


def at(picture, point):
    u, v, _ = VIEW.project([point], *SIZE)[0]
    return picture[int(v), int(u)]


def turned(rows, angle):
    """Rotate a mesh about the vertical axis [degrees]."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return rows @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def saturation(rgb):
    return float(1.0 - rgb.min() / rgb.max())


def test_the_back_of_a_cloth_is_shaded_as_a_side_of_its_own(renderer):
    """The back is paler than the front, for sheets with single triangles and with duplicate triangles."""
    for triangles in (FRONT, SHEET.surface):
        sides = [
            light(at(renderer.render([Surface(rows, triangles, color=PALETTE[2], look="cloth")]), (0, 0, 0)))
            for rows in (UPRIGHT, turned(UPRIGHT, 180.0))
        ]
        assert saturation(sides[0]) > 0.7
        assert saturation(sides[1]) < 0.75 * saturation(sides[0])
        assert sides[1].mean() > 0.1


def test_a_sheet_that_is_no_cloth_is_seen_from_its_front_only(renderer):
    nothing = renderer.render([])
    np.testing.assert_array_equal(renderer.render([Surface(turned(UPRIGHT, 180.0), FRONT)]), nothing)
    assert (renderer.render([Surface(UPRIGHT, FRONT)]) != nothing).any()


def test_normals_that_are_given_hold_for_both_sides_of_a_cloth(renderer):
    """Given normals that equal the computed ones give the same image."""
    for angle in (0.0, 180.0):
        rows = turned(UPRIGHT, angle)
        normal = turned(np.array([[0.0, -1.0, 0.0]]), angle)
        given = Surface(rows, FRONT, look="cloth", normals=np.repeat(normal, len(rows), axis=0))
        found = Surface(rows, FRONT, look="cloth")
        difference = renderer.render([given]).astype(int) - renderer.render([found])
        assert np.abs(difference).max() <= 1


def test_light_comes_through_a_cloth_but_not_through_rubber(renderer):
    """Lit from behind, as the camera sees it; the same sheet, its back to the key."""
    behind = turned(UPRIGHT, 0.0)
    away = Camera((0.0, 3.0, -1.0), (0.0, 0.0, 0.0))  # on the side without the key light
    from_behind = Renderer(*SIZE, camera=VIEW, floor=None)
    from_behind.camera = away
    pictures = {
        look: light(from_behind.render([Surface(behind, SHEET.surface, look=look)]))[80, 120]
        for look in ("cloth", "matte")
    }
    assert from_behind.sun @ np.array([0.0, -1.0, 0.0]) > 0.2
    assert pictures["cloth"].mean() > 1.3 * pictures["matte"].mean()


def test_light_goes_round_a_jelly_and_its_rim_is_bright(renderer):
    sun = renderer.sun
    side = np.cross(sun, (0.0, -1.0, 0.0))
    toward = np.array(VIEW.eye) / np.linalg.norm(VIEW.eye)
    # Just beyond the edge of the lit half, seen by the camera.
    edge = np.cross(side, sun)
    edge *= np.sign(edge @ toward) / np.linalg.norm(edge)
    beyond = 0.69 * (np.cos(0.3) * edge - np.sin(0.3) * sun)
    dark = {}
    rims = {}
    for look in Look:
        if look is Look.CLOTH:
            continue
        picture = light(renderer.render([Surface(BALL.vertices, BALL.surface, color=PALETTE[1], look=look)]))
        dark[look] = at(picture, beyond).mean()
        # The topmost pixel inside of the outline, and the middle of the ball.
        column = picture[:, SIZE[0] // 2]
        up = np.array([0.0, 0.0, 1.0]) - toward * toward[2]
        up /= np.linalg.norm(up)
        rims[look] = at(picture, 0.685 * (np.cos(0.42) * up + np.sin(0.42) * toward)).mean()
        assert np.isfinite(column).all()
    assert dark[Look.JELLY] > 1.3 * dark[Look.MATTE]
    assert rims[Look.JELLY] > 1.1 * rims[Look.MATTE]


@pytest.mark.parametrize("look", ["matte", "jelly"])
def test_colours_of_bodies_are_told_apart_as_before(renderer, look):
    """Under any look each colour of the palette, lit, is nearer to itself than to any other."""
    toward = np.array(VIEW.eye) / np.linalg.norm(VIEW.eye)
    spot = 0.6 * (toward + renderer.sun) / np.linalg.norm(toward + renderer.sun)
    spot = 0.69 * (0.75 * toward - 0.66 * np.cross(toward, renderer.sun))
    seen = []
    for color in PALETTE:
        picture = renderer.render([Surface(BALL.vertices, BALL.surface, color=color, look=look)])
        seen.append(at(picture, spot) / 255.0)
    asked = np.array(PALETTE)
    share = np.array(seen) / np.linalg.norm(seen, axis=1, keepdims=True)
    wanted = asked / np.linalg.norm(asked, axis=1, keepdims=True)
    distance = np.linalg.norm(share[:, None] - wanted[None], axis=2)
    assert (distance.argmin(axis=1) == np.arange(len(PALETTE))).all()


def test_an_unknown_look_is_refused_with_those_there_are():
    for bad in ("wood", None, 3):
        with pytest.raises(OptionError, match="matte"):
            Surface(BALL.vertices, BALL.surface, look=bad)
