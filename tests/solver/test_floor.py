"""Rest, restitution and friction on the floor."""

import numpy as np
import pytest

from taichi_soft import Material, box

EULER = {"integrator": "explicit_euler"}
FIRM = Material(young=1e6, poisson=0.2, density=1000.0, damping=300.0)


@pytest.mark.parametrize("height", [0.0, -2.5, 1.25])
def test_a_body_comes_to_rest_on_the_floor(solo, cube, height):
    world, body = solo(cube, FIRM, {"floor": height}, position=(0, 0, height + 1.0))
    floor = np.float32(height)
    for _ in range(600):
        world.step(1 / 60)
        assert body.positions()[:, 2].min() >= floor
    soles = cube.vertices[:, 2] == -0.5
    before = body.positions()
    np.testing.assert_allclose(before[soles, 2], floor, atol=1e-3)
    world.step(1 / 60)
    np.testing.assert_allclose(body.positions(), before, atol=1e-4)
    # Its own weight presses it together: rho g H^2 / 2 E on average in one dimension.
    sag = 1000 * 9.81 / (2 * 1e6)
    top = before[cube.vertices[:, 2] == 0.5, 2].mean() - floor
    assert 1 - 2 * sag < top < 1 - 0.5 * sag


@pytest.mark.soak
def test_without_a_floor_bodies_fall_on(solo, cube, jelly):
    world, body = solo(cube, jelly, {"floor": None})
    for _ in range(120):
        world.step(1 / 60)
    assert body.center_of_mass()[2] == pytest.approx(-0.5 * 9.81 * 4, rel=1e-3)


@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
def test_soles_leave_the_floor_with_the_restitution(solo, cube, jelly, restitution):
    """A flat fall: when the soles touch, no tetrahedron is deformed yet, so v+ = -e v- exactly."""
    options = {**EULER, "restitution": restitution, "gravity": (0, 0, 0)}
    world, body = solo(cube, jelly, options, position=(0, 0, 0.51), velocity=(0, 0, -3.0))
    for _ in range(5):
        world.step(1e-3, 1)
        soles = cube.vertices[:, 2] == -0.5
        if body.positions()[soles, 2].max() == 0.0:
            break
    np.testing.assert_allclose(body.velocities()[soles, 2], 3.0 * restitution, atol=1e-5)
    np.testing.assert_allclose(body.velocities()[~soles, 2], -3.0, atol=1e-5)


def test_what_lies_still_does_not_bounce(solo, cube, jelly):
    """Below 0.5 m/s the restitution is 0. Otherwise nothing would come to rest."""
    options = {**EULER, "restitution": 1.0, "gravity": (0, 0, 0)}
    world, body = solo(cube, jelly, options, position=(0, 0, 0.5001), velocity=(0, 0, -0.4))
    world.step(1e-3, 1)
    soles = cube.vertices[:, 2] == -0.5
    assert (body.velocities()[soles, 2] == 0.0).all()


def slide(solo, friction, seconds=1.5):
    """How far a brick goes that starts flat on the floor with 2 m/s, and its speed at the end."""
    mesh = box((1.0, 1.0, 0.5), (2, 2, 1))
    world, body = solo(mesh, FIRM, {"friction": friction}, position=(0, 0, 0.25), velocity=(2.0, 0, 0))
    start = body.center_of_mass()[0]
    for _ in range(round(seconds * 60)):
        world.step(1 / 60)
    return body.center_of_mass()[0] - start, body.momentum()[0] / 500


@pytest.mark.soak
def test_without_friction_nothing_is_lost(solo):
    way, speed = slide(solo, 0.0)
    assert way == pytest.approx(3.0, rel=1e-3)
    assert speed == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("friction", [0.3, 0.6])
def test_friction_stops_after_the_way_of_the_book(solo, friction):
    """v^2 / (2 mu g)"""
    way, speed = slide(solo, friction)
    assert way == pytest.approx(4 / (2 * friction * 9.81), rel=0.1)
    assert abs(speed) < 0.02


def test_much_friction_stops_at_once(solo):
    way, speed = slide(solo, 20.0)
    assert abs(way) < 0.1
    assert abs(speed) < 0.02


@pytest.mark.parametrize(("friction", "slides"), [(0.5, False), (0.3, True)])
def test_on_a_slope_a_body_creeps_down_only_above_the_angle_of_friction(solo, friction, slides):
    """The slope is gravity that leans: it slides where tan(angle) exceeds the coefficient."""
    gravity = (9.81 * np.sin(0.4), 0.0, -9.81 * np.cos(0.4))  # tan 0.4 = 0.42
    mesh = box((1.0, 1.0, 0.5), (2, 2, 1))
    world, body = solo(mesh, FIRM, {"friction": friction, "gravity": gravity}, position=(0, 0, 0.25))
    for _ in range(120):
        world.step(1 / 60)
    before = body.center_of_mass()[0]
    for _ in range(60):
        world.step(1 / 60)
    way = body.center_of_mass()[0] - before
    if slides:
        acceleration = 9.81 * (np.sin(0.4) - friction * np.cos(0.4))
        assert way == pytest.approx(acceleration * (9 - 4) / 2, rel=0.1)
    else:
        assert abs(way) < 1e-3
