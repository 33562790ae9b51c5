"""Projection against formulas written out here, framing, refusals."""

import math

import numpy as np
import pytest

from taichi_soft.core.errors import OptionError
from taichi_soft.render import Camera


def look_at(eye, target, up, fov, points, width, height):
    """Pixel and depth by turning and dividing, in float64, one point at a time."""
    eye, target, up = (np.asarray(v, dtype=float) for v in (eye, target, up))
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up) / np.linalg.norm(np.cross(forward, up))
    upright = np.cross(right, forward)
    pixels_per_tangent = min(width, height) / 2 / math.tan(math.radians(fov) / 2)
    rows = []
    for point in points:
        offset = np.asarray(point) - eye
        depth = offset @ forward
        rows.append(
            [
                width / 2 + pixels_per_tangent * (offset @ right) / depth,
                height / 2 - pixels_per_tangent * (offset @ upright) / depth,
                depth,
            ]
        )
    return np.array(rows)


@pytest.mark.parametrize("size", [(640, 360), (300, 500)])
def test_project_agrees_with_the_formula(size):
    rng = np.random.default_rng(5)
    for _ in range(20):
        eye, target, up = rng.normal(size=(3, 3))
        camera = Camera(tuple(eye), tuple(target), up=tuple(up), fov_degrees=55.0)
        points = target + 0.3 * rng.normal(size=(6, 3)) * np.linalg.norm(eye - target)
        expected = look_at(eye, target, up, 55.0, points, *size)
        seen = expected[:, 2] > camera.near
        np.testing.assert_allclose(camera.project(points, *size)[seen], expected[seen], rtol=1e-9, atol=1e-7)


def test_target_lies_in_the_middle_and_up_is_up():
    camera = Camera((3.0, -4.0, 2.0), (0.0, 0.5, 1.0))
    middle, above = camera.project([(0.0, 0.5, 1.0), (0.0, 0.5, 1.2)], 640, 360)
    np.testing.assert_allclose(middle[:2], (320, 180))
    assert above[1] < 179
    assert abs(above[0] - 320) < 1e-9


def test_points_behind_have_no_place():
    camera = Camera((0.0, -5.0, 0.0))
    behind = camera.project([(0.0, -6.0, 0.0)], 64, 64)[0]
    assert np.isnan(behind[:2]).all()
    assert behind[2] == pytest.approx(-1.0)


@pytest.mark.parametrize("size", [(1280, 720), (720, 1280), (500, 500), (1600, 200)])
@pytest.mark.parametrize("azimuth", [-60.0, 10.0, 200.0])
@pytest.mark.parametrize("elevation", [-20.0, 0.0, 35.0, 85.0])
def test_framing_sees_the_box_and_touches_its_limit(size, azimuth, elevation):
    low, high = np.array([-1.0, 0.0, -0.2]), np.array([3.0, 0.5, 2.0])
    corners = np.array([[x, y, z] for x in (-1, 3) for y in (0, 0.5) for z in (-0.2, 2)])
    half = np.array(size) / 2
    for aspect, limit in ((1.0, np.full(2, min(size) / 2)), (size[0] / size[1], half)):
        camera = Camera.framing(low, high, azimuth=azimuth, elevation=elevation, margin=1.0, aspect=aspect)
        reach = np.abs(camera.project(corners, *size)[:, :2] - half) / limit
        assert reach.max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"eye": (1.0, 2.0, 3.0), "target": (1.0, 2.0, 3.0)}, "eye"),
        ({"up": (0.0, 0.0, 0.0)}, "up"),
        ({"up": (0.0, -5.0, 0.0)}, "line of sight"),
        ({"eye": (0.0, math.nan, 0.0)}, "eye must be finite"),
        ({"eye": (0.0, 1.0)}, "eye must have shape"),
        ({"target": "origin"}, "target"),
        ({"fov_degrees": 0.0}, "fov_degrees"),
        ({"fov_degrees": 170.0}, "fov_degrees"),
        ({"fov_degrees": math.nan}, "fov_degrees"),
        ({"fov_degrees": True}, "fov_degrees"),
    ],
)
def test_bad_cameras_are_refused(changes, words):
    with pytest.raises(OptionError, match=words):
        Camera(**{"eye": (0.0, -5.0, 0.0), **changes})


@pytest.mark.parametrize(
    "box", [((0, 0, 0), (0, 0, 0)), ((1, 0, 0), (0, 1, 1)), ((0, 0, 0), (1, math.inf, 1)), ((0, 0), (1, 1))]
)
def test_bad_boxes_are_refused(box):
    with pytest.raises(OptionError):
        Camera.framing(*box)


def test_a_camera_cannot_be_changed():
    camera = Camera((0.0, -5.0, 0.0))
    with pytest.raises(AttributeError):
        camera.eye = (1.0, 1.0, 1.0)
