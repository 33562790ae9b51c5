"""A camera that sees all of where bodies go, and a camera that is moved to see a box."""

import math

import numpy as np
import pytest

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Material, OptionError, box
from taichi_soft.render import Camera
from taichi_soft.render.camera_moves import Orbit
from taichi_soft.render.film import Actor, Stage
from taichi_soft.render.framing import framed
from taichi_soft.world.bare import bare_world


def thrown(camera=None):
    """A box that flies five metres to the right, whose script counts its calls."""
    world = bare_world(floor=None)
    body = world.add_body(box((1, 1, 1), (1, 1, 1)), Material(1e5, 0.2, 1000), position=(0, 0, 4))
    world.build()
    body.set_velocity((5.0, 0.0, 0.0))
    calls = []
    camera = camera or Camera((0.0, -6.0, 5.0), (0.0, 0.0, 4.0), fov_degrees=30.0)
    stage = Stage("", world, [Actor(body)], camera, FixedStep(dt=1 / 50), 1.0, act=calls.append)
    stage.calls = calls
    return stage


def test_a_framed_stage_sees_its_bodies_wherever_they_go_and_is_as_it_was_at_the_start():
    stage = framed(thrown, aspect=16 / 9)
    before = thrown()
    assert stage.calls == []
    assert stage.world.state_hash() == before.world.state_hash()
    way = np.subtract(stage.camera.eye, stage.camera.target)
    old = np.subtract(before.camera.eye, before.camera.target)
    np.testing.assert_allclose(way / np.linalg.norm(way), old / np.linalg.norm(old), atol=1e-6)
    game = EngineAdapter(stage.world, stage.step)
    reach = []
    for _ in range(50):
        pixels = stage.camera.project(stage.actors[0].body.positions(), 1280, 720)
        assert ((pixels[:, :2] > 0) & (pixels[:, :2] < (1280, 720))).all()
        reach.append(np.abs(pixels[:, :2] / (640, 360) - 1.0).max())
        game.step()
    assert max(reach) > 0.75  # the camera is not farther away than necessary


@pytest.mark.parametrize("eye", [(3.0, -4.0, 2.0), (-1.0, 5.0, -2.0), (0.2, 0.1, 9.0)])
def test_a_camera_that_is_to_see_a_box_looks_the_same_way_as_before(eye):
    camera = Camera(eye, (0.0, 0.0, 0.0), fov_degrees=50.0)
    low, high = (1.0, 2.0, 0.0), (4.0, 3.0, 1.0)
    moved = camera.seeing(low, high, margin=1.0, aspect=16 / 9)
    assert moved.fov_degrees == 50.0
    one, other = (np.subtract(c.eye, c.target) / c.distance for c in (camera, moved))
    np.testing.assert_allclose(one, other, atol=1e-6)
    corners = np.array([[x, y, z] for x in (1, 4) for y in (2, 3) for z in (0, 1)])
    pixels = np.abs(moved.project(corners, 1280, 720)[:, :2] / (640, 360) - 1.0)
    assert pixels.max() == pytest.approx(1.0, abs=1e-6)


def test_one_that_looks_straight_down_looks_a_little_aside():
    camera = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    moved = camera.seeing((-1, -1, 0), (1, 1, 1))
    way = np.subtract(moved.eye, moved.target) / moved.distance
    assert math.degrees(math.asin(way[2])) == pytest.approx(89.0)


def test_a_camera_that_moves_by_itself_is_not_framed():
    view = Camera((0.0, -6.0, 5.0), (0.0, 0.0, 4.0))
    with pytest.raises(OptionError, match="Orbit"):
        framed(lambda: thrown(Orbit(view)))


@pytest.mark.parametrize("period", [2.0, -0.7])
def test_a_camera_that_goes_round_sees_bodies_from_all_sides_and_is_as_near_as_it_can_be(period):
    stage = framed(thrown, aspect=16 / 9, orbit=period)
    game = EngineAdapter(stage.world, stage.step)
    reach = []
    for _ in range(49):  # a film shows the states between the last step and the one before
        rows = stage.actors[0].body.positions()
        for turn in np.linspace(0.0, 1.0, 24, endpoint=False):
            camera = stage.camera.at(turn * period, None)
            pixels = camera.project(rows, 1280, 720)
            reach.append(np.abs(pixels[:, :2] / (640, 360) - 1.0).max())
        game.step()
    assert stage.camera.period == period
    assert 0.75 < max(reach) < 1.0


def test_a_camera_that_would_never_come_round_is_refused_before_anything_moves():
    made = []
    with pytest.raises(OptionError, match="period"):
        framed(lambda: made.append(thrown()) or made[-1], orbit=0.0)
    assert made == []
