"""Cameras that move: where they are at a time, written out."""

import math

import numpy as np
import pytest

from taichi_soft import Material, OptionError, box
from taichi_soft.render import Camera
from taichi_soft.render.camera_moves import Follow, Orbit
from taichi_soft.world.bare import bare_world

VIEW = Camera((1.0, -5.0, 2.5), (0.5, 0.2, 1.0), fov_degrees=35.0)
SIZE = (320, 180)


@pytest.fixture(scope="module")
def body():
    world = bare_world()
    return world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000), position=(0, 0, 2))


def box_at(middle):
    return lambda body: np.array([middle, middle]) + np.array([[-0.4], [0.4]])


def nowhere(body):
    raise AssertionError


def test_an_orbit_keeps_its_distance_its_height_and_its_target():
    orbit = Orbit(VIEW, period=8.0)
    eyes = []
    for time in np.linspace(0.0, 8.0, 33):
        camera = orbit.at(time, nowhere)
        assert camera.distance == pytest.approx(VIEW.distance)
        assert camera.eye[2] == pytest.approx(VIEW.eye[2])
        assert camera.target == VIEW.target
        assert camera.fov_degrees == VIEW.fov_degrees
        eyes.append(np.subtract(camera.eye, camera.target)[:2])
    np.testing.assert_allclose(eyes[0], eyes[-1], atol=1e-9)
    angles = np.unwrap([math.atan2(y, x) for x, y in eyes])
    np.testing.assert_allclose(np.diff(angles), 2 * math.pi / 32, atol=1e-9)  # anticlockwise, evenly
    other = Orbit(VIEW, period=-8.0).at(1.0, nowhere)
    np.testing.assert_allclose(other.eye, orbit.at(7.0, nowhere).eye)


def test_a_camera_that_follows_has_the_body_near_its_middle_however_fast_it_is(body):
    """Within a third of the way from the middle to the nearer edge, and a bit for what is near the eye."""
    for speed in (0.1, 3.0, 200.0):
        follow = Follow(body, VIEW, lag=0.3)
        for time in np.linspace(0.0, 2.0, 101):
            middle = np.array([speed * time, 0.3 * speed * time, 1.0 + abs(math.sin(9.0 * time))])
            camera = follow.at(time, box_at(middle))
            u, v, _ = camera.project([middle], *SIZE)[0]
            assert math.hypot(u - SIZE[0] / 2, v - SIZE[1] / 2) < 0.45 * SIZE[1] / 2
            np.testing.assert_allclose(
                np.subtract(camera.eye, camera.target), np.subtract(VIEW.eye, VIEW.target), atol=1e-9
            )


def test_without_a_lag_the_body_stays_in_the_middle_and_with_one_its_trembling_is_not_seen(body):
    rng = np.random.default_rng(1)
    steady, loose = Follow(body, VIEW, lag=0.0), Follow(body, VIEW, lag=0.5)
    moved = []
    for number, shake in enumerate(0.02 * rng.normal(size=(200, 3))):
        camera = steady.at(0.02 * number, box_at(shake))
        np.testing.assert_allclose(camera.target, shake, atol=1e-12)
        moved.append(loose.at(0.02 * number, box_at(shake)).target)
    assert np.std(moved[50:], axis=0).max() < 0.25 * 0.02


def test_it_comes_nearer_by_e_within_its_lag_whatever_the_frame_rate(body):
    for frames in (1, 7, 50):
        follow = Follow(body, VIEW, lag=0.4)
        follow.at(0.0, box_at(np.zeros(3)))
        for number in range(1, frames + 1):
            camera = follow.at(0.4 * number / frames, box_at(np.array([0.1, 0.0, 0.0])))
        assert 0.1 - camera.target[0] == pytest.approx(0.1 / math.e)


def test_the_same_time_twice_is_the_same_place_and_an_earlier_one_begins_anew(body):
    follow = Follow(body, VIEW)
    follow.at(0.0, box_at(np.zeros(3)))
    first = follow.at(0.1, box_at(np.ones(3)))
    assert follow.at(0.1, box_at(np.ones(3))) == first
    assert follow.at(0.0, box_at(np.ones(3))).target == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("period", [0.0, math.nan, math.inf, "x"])
def test_a_bad_period_is_refused(period):
    with pytest.raises(OptionError, match="period"):
        Orbit(VIEW, period)


def test_what_is_no_view_no_body_or_no_lag_is_refused(body):
    with pytest.raises(OptionError, match="view"):
        Orbit((1, 2, 3))
    with pytest.raises(OptionError, match="view"):
        Follow(body, None)
    with pytest.raises(OptionError, match="body"):
        Follow("duck", VIEW)
    for lag in (-1.0, math.nan):
        with pytest.raises(OptionError, match="lag"):
            Follow(body, VIEW, lag=lag)
