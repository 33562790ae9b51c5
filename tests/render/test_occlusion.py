"""What stands close takes light: by places of which it is known what is in their way."""

import numpy as np
import pytest

from taichi_soft import init
from taichi_soft.meshing import box, sphere
from taichi_soft.render import Camera, Renderer, Surface
from taichi_soft.render.colors import to_linear

SIZE = (640, 360)
CAMERA = Camera((0.0, -4.0, 2.2), (0.0, 0.0, 0.3))
BALL = sphere(radius=0.5, resolution=5)
SLAB = box((3.0, 3.0, 0.4), (3, 3, 1))
SLAB_AT = SLAB.vertices - np.mean(SLAB.bounds, axis=0) - np.array([0.0, 0.0, 0.2])  # its top is at z = 0
WHITE = (0.8, 0.8, 0.8)


@pytest.fixture(scope="module", autouse=True)
def _taichi():
    init("cpu")


@pytest.fixture(scope="module")
def renderer():
    return Renderer(*SIZE, camera=CAMERA, floor=None)


def slab():
    return Surface(SLAB_AT, SLAB.surface, color=WHITE)


def ball(height):
    """Its lowest point so high above the slab [m]."""
    return Surface(BALL.vertices + np.array([0.0, 0.0, 0.5 + height]), BALL.surface, color=WHITE)


def pixel(point):
    u, v, _ = CAMERA.project([point], *SIZE)[0]
    return int(v), int(u)


def light(picture):
    return to_linear(picture.astype(np.float32) / 255.0).mean(axis=2)


def test_a_point_under_a_body_gets_darker_as_the_body_comes_nearer(renderer):
    """The point is on the side of the key light, without shadow."""
    toward = renderer.sun[:2] / np.linalg.norm(renderer.sun[:2])
    spot = pixel([*(0.20 * toward), 0.0])
    free = light(renderer.render([slab()]))[spot]
    seen = [light(renderer.render([slab(), ball(height)]))[spot] for height in (0.25, 0.12, 0.06, 0.0)]
    assert seen[0] < 1.01 * free
    assert (np.diff(seen) < 0.003).all()
    assert seen[-1] < 0.92 * free


def test_what_bends_outwards_hides_nothing_from_itself(renderer):
    for alone in (ball(0.0), slab()):
        renderer.render([alone])
        rows = renderer._occlusion.hidden[renderer._occlusion.depth > 0.0]
        assert rows.max() < 0.02


def test_in_a_corner_more_is_hidden_the_nearer_to_it_and_nothing_far_from_it(renderer):
    wall = box((3.0, 0.2, 1.5), (3, 1, 2))
    rows = wall.vertices - np.mean(wall.bounds, axis=0) + np.array([0.0, 0.9, 0.75])
    renderer.render([slab(), Surface(rows, wall.surface, color=WHITE)])
    away = np.array([0.03, 0.08, 0.14, 0.8])  # from the wall [m]
    hidden = []
    for distance in away:
        row, column = pixel([0.0, 0.8 - distance, 0.0])
        hidden.append(float(renderer._occlusion.hidden[row // 2, column // 2]))
    assert hidden[0] > 0.25
    assert (np.diff(hidden) < 0.0).all()
    assert hidden[-1] < 0.01


def test_a_body_far_behind_takes_no_light(renderer):
    """In the image, the body touches the ball, but it is three metres behind the ball."""
    behind = Surface(SLAB_AT * (1, 0.1, 6) + np.array([0.0, 4.0, 0.0]), SLAB.surface, color=WHITE)
    one = renderer.render([ball(0.0)])
    other = renderer.render([ball(0.0), behind])
    for angle in np.radians([20.0, 60.0, 120.0, 160.0]):
        spot = pixel([0.4 * np.cos(angle), 0.0, 0.5 + 0.4 * np.sin(angle)])
        assert np.abs(one[spot].astype(int) - other[spot]).max() <= 2
