"""Whole pictures: light, shadows, smooth outlines, the same bits every time, refusals."""

import hashlib
import itertools
import subprocess
import sys
import textwrap

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.core.errors import OptionError
from taichi_soft.meshing import box, sphere
from taichi_soft.render import Camera, Renderer, Surface
from taichi_soft.render.backdrop import Backdrop
from taichi_soft.render.colors import to_linear

SIZE = (320, 180)
BALL = sphere(radius=0.5, resolution=4)
CAMERA = Camera.framing((-1.0, -1.0, 0.0), (1.0, 1.0, 1.6), elevation=25.0)

ABOVE = Camera((0.0, -0.5, 9.0), fov_degrees=26.0)


@pytest.fixture(scope="module", autouse=True)
def _taichi():
    init("cpu")


@pytest.fixture(scope="module")
def renderer():
    return Renderer(*SIZE, camera=CAMERA)


@pytest.fixture(scope="module")
def empty(renderer):
    return renderer.render([])


@pytest.fixture(scope="module")
def above():
    renderer = Renderer(*SIZE, camera=ABOVE)
    return renderer, renderer.render([])


def ball(x=0.0, y=0.0, z=0.5, **kwargs):
    return Surface(BALL.vertices + np.array([x, y, z]), BALL.surface, **kwargs)


def light(picture):
    """Return the linear luminance."""
    return to_linear(picture.astype(np.float32) / 255.0) @ np.float32([0.2126, 0.7152, 0.0722])


def pixel(point, camera=CAMERA):
    u, v, _ = camera.project([point], *SIZE)[0]
    return int(v), int(u)


def test_picture_has_the_shape_and_is_the_callers_own(renderer):
    first = renderer.render([ball()])
    kept = first.copy()
    second = renderer.render([ball(z=1.0)])
    assert first.shape == (180, 320, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, kept)
    assert (first != second).any()


def test_empty_scene_shows_checks_and_fades_to_the_horizon(empty):
    middle, horizon = light(empty)[90:170], light(empty)[:4]
    assert middle.std() > 0.03  # checks
    assert horizon.std() < 0.02
    assert (empty > 20).all()


def test_the_body_has_its_own_color_in_red_green_blue_order(renderer):
    for channel in range(3):
        color = np.full(3, 0.1)
        color[channel] = 0.9
        row, column = pixel((0.0, 0.0, 0.5))
        seen = renderer.render([ball(color=color)])[row, column].astype(int)
        assert (seen[channel] > np.delete(seen, channel) + 60).all()


def test_vertex_colors_lie_where_their_vertices_are(renderer):
    surface = ball()
    surface.color = np.where(BALL.vertices[:, 2:] > 0.0, (0.9, 0.1, 0.1), (0.1, 0.1, 0.9))
    picture = renderer.render([surface]).astype(int)
    top, low = picture[pixel((0.0, 0.0, 0.85))], picture[pixel((0.0, -0.3, 0.2))]
    assert top[0] > top[2] + 40
    assert low[2] > low[0] + 40


def test_the_nearer_body_hides_the_farther_whatever_the_order(renderer):
    toward = np.array(CAMERA.eye) / np.linalg.norm(CAMERA.eye)
    near, far = ball(*(0.8 * toward + [0, 0, 0.3]), color=(0.9, 0.1, 0.1)), ball(color=(0.1, 0.1, 0.9))
    one, other = renderer.render([near, far]), renderer.render([far, near])
    np.testing.assert_array_equal(one, other)
    row, column = pixel(0.8 * toward + [0, 0, 0.3])
    assert one[row, column, 0] > one[row, column, 2] + 40


def in_sight(point, center):
    """Return True if the ball about `center` does not hide `point` from above."""
    way = np.array(point) - ABOVE.eye
    nearest = np.array(ABOVE.eye) + way * ((center - np.array(ABOVE.eye)) @ way / (way @ way))
    return np.linalg.norm(nearest - center) > 0.52


def test_shadow_falls_where_the_sun_casts_it(above):
    renderer, empty = above
    center = np.array([0.0, 0.0, 1.0])
    ratio = light(renderer.render([ball(*center)])) / light(empty)
    sun = renderer.sun
    below = center - sun * (center[2] / sun[2])  # where the ray through the centre meets the floor
    # The shadow of a sphere is an ellipse: radius 0.5 across the sun's path, 0.5 / sin(elevation) along it.
    along = np.array([sun[0], sun[1], 0.0]) / np.hypot(sun[0], sun[1])
    across = np.array([-along[1], along[0], 0.0])
    inside = outside = 0
    for angle in np.linspace(0.0, 2 * np.pi, 24, endpoint=False):
        edge = 0.5 / sun[2] * np.cos(angle) * along + 0.5 * np.sin(angle) * across
        if in_sight(below + 0.6 * edge, center):
            assert ratio[pixel(below + 0.6 * edge, ABOVE)] < 0.75
            inside += 1
        if in_sight(below + 1.5 * edge, center):
            assert ratio[pixel(below + 1.5 * edge, ABOVE)] > 0.93
            outside += 1
        if in_sight(below + edge, center):
            assert 0.5 < ratio[pixel(below + edge, ABOVE)] < 0.97
    assert min(inside, outside) > 8


def test_shadow_edge_is_soft_and_softer_from_higher_up(above):
    renderer, empty = above
    sun = renderer.sun
    away = -np.array([sun[0], sun[1], 0.0]) / np.hypot(sun[0], sun[1])
    widths = []
    for height in (0.5, 1.4):
        center = np.array([0.0, 0.0, height])
        ratio = light(renderer.render([ball(*center)])) / light(empty)
        tip = center - sun * (height / sun[2]) + 0.5 / sun[2] * away  # where the shadow of the rim ends
        line = tip + np.linspace(-0.25, 0.25, 200)[:, None] * away
        assert all(in_sight(point, center) for point in line)
        profile = np.array([ratio[pixel(point, ABOVE)] for point in line])
        share = (profile - profile[0]) / (profile[-1] - profile[0])
        widths.append(((share > 0.2) & (share < 0.8)).mean() * 0.5)
    assert 0.01 < widths[0] < 0.2
    assert widths[1] > 1.3 * widths[0]


def test_one_body_shadows_another(renderer):
    sun = renderer.sun
    low = ball(0.0, 0.0, 0.5, color=(0.8, 0.8, 0.8))
    above = np.array([0.0, 0.0, 0.5]) + 1.6 * sun
    lit = renderer.render([low])
    shaded = renderer.render([low, ball(*above)])
    # On the line of sight to the sun, nudged to the side that the camera sees.
    spot = np.array([0.0, 0.0, 0.5]) + 0.5 * sun
    assert light(shaded)[pixel(spot)] < 0.75 * light(lit)[pixel(spot)]


def test_a_lit_ball_has_no_stripes(renderer):
    # Along the arc from the brightest place to the rim, light only falls: stripes of self-shadow would not.
    picture = light(renderer.render([ball(color=(0.7, 0.7, 0.7))]))
    sun = renderer.sun
    side = np.cross(sun, np.cross(np.array(CAMERA.eye) - CAMERA.target, sun))
    side /= np.linalg.norm(side)
    angles = np.radians(np.linspace(35.0, 85.0, 40))
    points = [np.array([0, 0, 0.5]) + 0.49 * (np.cos(a) * sun + np.sin(a) * side) for a in angles]
    profile = np.array([picture[pixel(point)] for point in points])
    assert (np.diff(profile) < 0.02).all()


def test_the_floor_is_darker_where_a_body_touches_it(renderer, empty):
    cube = box((0.8, 0.8, 0.8), (2, 2, 2))
    low, high = (Surface(cube.vertices + np.array([0.0, 0.0, z]), cube.surface) for z in (0.4, 0.9))
    lit_side = np.array([*renderer.sun[:2], 0.0]) / np.hypot(*renderer.sun[:2])
    spot = pixel(0.62 * lit_side)
    touching, floating = (light(renderer.render([s]))[spot] / light(empty)[spot] for s in (low, high))
    assert touching <= floating


def test_outline_is_smooth():
    # A dark ball on a bright sky: along its outline many levels lie between the two.
    camera = Camera((0.0, -4.0, 0.0))
    picture = Renderer(*SIZE, camera=camera, floor=None).render(
        [Surface(BALL.vertices, BALL.surface, color=(0.0, 0.0, 0.0))]
    )
    gray = picture.mean(axis=2)
    levels = {round(x) for x in gray[60:120].ravel()} - set(range(0, 90)) - set(range(200, 256))
    crossings = ((gray[:, :-1] < 120) != (gray[:, 1:] < 120)).sum()
    between = ((gray > 90) & (gray < 190)).sum()
    assert crossings > 50
    assert between > 0.5 * crossings
    assert len(levels) >= 5


def test_covered_area_of_a_ball_is_that_of_its_outline():
    camera = Camera((0.0, -6.0, 0.0), fov_degrees=25.0)
    fine = sphere(radius=0.9, resolution=10)
    picture = Renderer(*SIZE, camera=camera, floor=None).render([Surface.of(fine, color=(1.0, 0.0, 0.0))])
    red = (picture[..., 0].astype(int) - picture[..., 2]) > 40
    tangent = 0.9 / np.sqrt(36.0 - 0.81)  # of the cone from the eye round the ball
    radius = tangent / np.tan(np.radians(12.5)) * 90
    assert red.sum() == pytest.approx(np.pi * radius**2, rel=0.03)


def test_what_sinks_into_the_floor_is_hidden(renderer, empty):
    buried = renderer.render([ball(z=-0.8)])
    np.testing.assert_array_equal(buried, empty)
    half = renderer.render([ball(z=0.0, color=(0.9, 0.1, 0.1))]).astype(int)
    red = (half[..., 0] - half[..., 2]) > 50
    assert red[pixel((0.0, 0.0, 0.3))]
    assert not red[pixel((0.3, -0.5, -0.2))]


def test_bodies_behind_below_and_around_the_camera_do_not_crash(renderer):
    eye = np.array(CAMERA.eye)
    places = [
        2.5 * eye,
        eye,
        eye + np.array([0.2, 0.0, 0.0]),
        [0.0, 0.0, -50.0],
        [1e5, 0.0, 0.0],
        [9e6, 9e6, 9e6],
    ]
    for place in places:
        assert renderer.render([ball(*place)]).shape == (180, 320, 3)
    assert renderer.render([ball(*place) for place in places]).std() > 1


def test_a_body_that_flies_away_leaves_the_others_shadows(renderer, empty):
    here = renderer.render([ball()])
    both = renderer.render([ball(), ball(5e4, 0.0, 0.5)])
    assert np.abs(here.astype(int) - both).max() <= 1
    np.testing.assert_array_equal(renderer.render([]), empty)


def test_camera_may_move(renderer, empty):
    renderer.camera = Camera((4.0, 3.0, 2.0))
    moved = renderer.render([ball()])
    fresh = Renderer(*SIZE, camera=Camera((4.0, 3.0, 2.0))).render([])
    renderer.camera = CAMERA
    assert (moved != fresh).any()
    np.testing.assert_array_equal(renderer.render([]), empty)


def test_what_stands_behind_a_jelly_shines_through_it_in_its_colour_and_behind_rubber_does_not(renderer):
    """Light of a red ball reaches the eye through the middle of a slab, and only what the slab lets pass."""
    slab = box((1.6, 0.2, 1.2), (2, 1, 2))
    slab = slab.translated(-np.mean(slab.bounds, axis=0))
    eye, target = np.array(CAMERA.eye), np.array(CAMERA.target)
    view = (eye - target) / np.linalg.norm(eye - target)
    across = np.cross((0.0, 0.0, 1.0), view)
    axes = np.stack([across / np.linalg.norm(across), -view, np.cross(-view, -across)], axis=1)
    axes /= np.linalg.norm(axes, axis=0)
    place = slab.vertices @ axes.T + target + 0.9 * view
    behind = ball(*target, color=(1.0, 0.1, 0.1))
    row, column = pixel(target)
    change = {}
    for look, color in (("jelly", (0.9, 0.9, 0.9)), ("jelly", (0.05, 0.9, 0.9)), ("matte", (0.9, 0.9, 0.9))):
        front = Surface(place, slab.surface, color=color, look=look)
        with_ball, without = (
            to_linear(renderer.render(surfaces)[row, column].astype(np.float32) / 255.0)
            for surfaces in ([front, behind], [front])
        )
        change[look, color[0]] = with_ball - without
    assert change["jelly", 0.9][0] > change["jelly", 0.9][1] + 0.05  # redder
    assert change["jelly", 0.9][1] < -0.05  # a ball that is not green is in front of a floor that is
    assert abs(change["jelly", 0.05][0]) < 0.5 * abs(change["jelly", 0.9][0] - change["jelly", 0.9][1])
    assert np.abs(change["matte", 0.9]).max() < 0.01


def test_every_backdrop_looks_different():
    pictures = [Renderer(*SIZE, camera=CAMERA, backdrop=each).render([]) for each in Backdrop]
    for one, other in itertools.combinations(pictures, 2):
        assert np.abs(one.astype(int) - other).max() > 20
    with pytest.raises(OptionError, match=r"unknown backdrop 'noon'.*'dusk'"):
        Renderer(*SIZE, camera=CAMERA, backdrop="noon")


def test_floor_height_and_no_floor():
    raised = Renderer(*SIZE, camera=Camera((0.0, -4.0, 2.0), (0.0, 0.0, 1.0)), floor=1.0, check=0.5)
    lying = Renderer(*SIZE, camera=Camera((0.0, -4.0, 1.0), (0.0, 0.0, 0.0)), floor=0.0, check=0.5)
    difference = raised.render([ball(z=1.5)]).astype(int) - lying.render([ball(z=0.5)])
    assert np.abs(difference).mean() < 0.5
    air = Renderer(*SIZE, camera=CAMERA, floor=None).render([ball()])
    below = Renderer(*SIZE, camera=Camera((0.0, -4.0, -1.0), (0.0, 0.0, 0.5))).render([ball()])
    assert air.std() > 5
    assert below.std() > 5


SCRIPT = """
import hashlib, sys
from taichi_soft import init
init("cpu", threads=int(sys.argv[1]))
from taichi_soft.meshing import sphere, torus
from taichi_soft.render import Camera, Renderer, Surface
ball, ring = sphere(0.5, 4), torus()
parts = [Surface(ball.vertices + [0.3 * i - 1, 0.2 * i, 0.5 + 0.3 * i], ball.surface) for i in range(5)]
parts.append(Surface(ring.vertices + [0, 0, 0.5], ring.surface, color=(0.2, 0.5, 0.6), look="jelly"))
parts.append(Surface(ball.vertices + [1, 0, 0.5], ball.surface[:40], look="cloth"))
picture = Renderer(322, 182, camera=Camera.framing((-1, -1, 0), (1, 1, 1.6))).render(parts)
print(hashlib.sha256(picture.tobytes()).hexdigest())
"""


@pytest.mark.soak
def test_same_bits_for_one_thread_and_two_and_every_time(renderer):
    first, second = (renderer.render([ball(), ball(0.6, 0.2, 1.2)]) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    hashes = [
        subprocess.run(
            [sys.executable, "-c", textwrap.dedent(SCRIPT), threads],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2")
    ]
    assert len(hashes[0].strip()) == len(hashlib.sha256().hexdigest())
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width": 0}, "width"),
        ({"width": 100000}, "width"),
        ({"height": 12.5}, "height"),
        ({"height": True}, "height"),
        ({"camera": "here"}, "camera must be a Camera"),
        ({"floor": np.nan}, "floor"),
        ({"check": 0.0}, "check"),
        ({"check": -1.0}, "check"),
    ],
)
def test_bad_arguments_are_refused(changes, words):
    with pytest.raises(OptionError, match=words):
        Renderer(**{"width": 64, "height": 48, "camera": CAMERA, **changes})


def test_what_is_not_a_surface_is_refused(renderer):
    with pytest.raises(OptionError, match="Surface"):
        renderer.render([BALL])
    with pytest.raises(OptionError, match="camera"):
        renderer.camera = None
