"""Wind on surfaces, against closed forms of drag."""

import numpy as np
import pytest

from taichi_soft import Material, OptionError, SpringMaterial, box, cloth, sphere
from taichi_soft.world.bare import bare_world

AIR = 1.2


def drag_speed(start, k, t):
    """Return the speed of a body with the drag k v |v|: v' = -k v^2."""
    return start / (1 + k * start * t)


@pytest.fixture(scope="module")
def blown():
    """A light box and a light ball."""
    world = bare_world(floor=-1e3)  # far below; the floor lets all tests share kernels
    foam = Material(1e5, 0.2, 20.0, 0.5)
    cube = world.add_body(box(cells=(2, 2, 2)), foam)
    ball = world.add_body(sphere(0.5, 6), foam, position=(5, 0, 0))
    world.build()
    return world, cube, ball


@pytest.fixture
def windy(blown):
    world, cube, ball = blown
    for body, place in ((cube, 0.0), (ball, 5.0)):
        body.unpin()
        body.set_sheltered(False)
        body.set_gravity_scale(0)
        body.set_motion(body.mesh.vertices + np.array([place, 0, 0]), np.zeros((body.vertex_count, 3)))
    world.set_wind(None)
    return world, cube, ball


def test_a_box_takes_on_the_speed_of_the_wind_as_drag_says(windy):
    world, cube, _ = windy
    world.set_wind((0, 6.0, 0), drag=1.5)
    k = 0.5 * AIR * 1.5 * 1.0 / cube.masses.sum()
    for _ in range(30):
        world.step(1 / 60)
    speed = cube.momentum() / cube.masses.sum()
    assert speed[1] == pytest.approx(6 - drag_speed(6.0, k, 0.5), rel=2e-3)
    np.testing.assert_allclose(speed[[0, 2]], 0, atol=5e-3)


def test_a_ball_has_half_the_drag_of_a_plate(windy):
    """The factor is the mean of cos^2 over the projected area.

    The flat triangles of the ball reflect slightly less.
    """
    world, _, ball = windy
    world.set_wind((0, 5.0, 0))
    world.step(1 / 600)
    faces = ball.mesh.vertices[ball.surface]
    normal = 0.5 * np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    area = np.linalg.norm(normal, axis=1)
    expected = 0.25 * AIR * 25 * (np.abs(normal[:, 1]) ** 3 / area**2).sum()
    assert ball.momentum()[1] * 600 == pytest.approx(expected, rel=1e-2)
    assert expected == pytest.approx(0.5 * 0.5 * AIR * np.pi * 0.25 * 25, rel=0.1)


def test_a_falling_box_reaches_its_terminal_speed(windy):
    """v = v_t tanh(g t / v_t) with v_t^2 = 2 m g / (rho c_d A)."""
    world, cube, _ = windy
    cube.set_gravity_scale(1.0)
    world.set_wind((0, 0, 0), density=12.0)
    terminal = np.sqrt(2 * cube.masses.sum() * 9.81 / 12.0)
    for _ in range(30):
        world.step(1 / 60)
    speed = -cube.momentum()[2] / cube.masses.sum()
    assert speed == pytest.approx(terminal * np.tanh(9.81 * 0.5 / terminal), rel=1e-2)
    for _ in range(90):
        world.step(1 / 60)
    assert -cube.momentum()[2] / cube.masses.sum() == pytest.approx(terminal, rel=1e-2)


@pytest.mark.parametrize("speed", [30.0, 1.9e4])
def test_no_wind_takes_a_vertex_beyond_itself(windy, speed):
    """A storm as dense as rock, in a step too short for elastic forces to have a say."""
    world, *bodies = windy
    wind = np.array([0.6, 0, 0.8]) * speed
    world.set_wind(wind, density=1e5, drag=10.0)
    for _ in range(3):
        before = [np.linalg.norm(body.velocities() - wind, axis=1) for body in bodies]
        world.step(2e-5 * 30 / speed, 1)
        for body, gap in zip(bodies, before, strict=True):
            assert (np.linalg.norm(body.velocities() - wind, axis=1) < gap + 1e-3 * speed).all()
    assert bodies[0].momentum()[0] / bodies[0].masses.sum() > 0.1 * speed


def test_a_storm_carries_bodies_off_whole(windy):
    world, *bodies = windy
    world.set_wind((0, 25.0, 0), density=20.0)
    for _ in range(60):
        world.step(1 / 60)
    for body in bodies:
        assert body.momentum()[1] / body.masses.sum() == pytest.approx(25, rel=0.1)
        assert np.abs(np.ptp(body.positions(), axis=0) - 1).max() < 0.5
        assert body.flipped_count() == 0
        assert not body.is_frozen


def test_a_sheltered_body_feels_no_wind_and_none_blows_when_it_is_off(windy):
    world, cube, ball = windy
    cube.set_sheltered(True)
    world.set_wind((3, 0, 0))
    for _ in range(5):
        world.step(1 / 60)
    assert np.abs(cube.momentum()).max() < 1e-6
    assert ball.momentum()[0] > 0.1
    world.set_wind(None)
    before = ball.momentum()
    for _ in range(5):
        world.step(1 / 60)
    np.testing.assert_allclose(ball.momentum(), before, atol=1e-5)


def test_a_flag_flies_with_the_wind():
    """A sheet has each triangle twice, and so the drag of a plate: at once 1/2 rho A v^2."""
    world = bare_world(floor=None, gravity=(0, 0, 0))
    mesh = cloth((1.0, 0.6), (10, 6), 0.2)
    body = world.add_body(mesh, SpringMaterial(200.0, 0.02), law="springs")
    world.build()
    world.set_wind((0, 0, 4.0))
    world.step(1e-4, 1)
    area = np.ptp(mesh.vertices[:, 0]) * np.ptp(mesh.vertices[:, 1])
    assert body.momentum()[2] * 1e4 == pytest.approx(0.5 * AIR * area * 16, rel=1e-3)
    body.pin(np.flatnonzero(mesh.vertices[:, 0] <= mesh.vertices[:, 0].min() + 1e-9))
    world.set_wind((4.0, 0, 0.5))
    for _ in range(60):
        world.step(1 / 60)
    assert not body.is_frozen
    assert np.isfinite(body.positions()).all()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda w, b: w.set_wind((float("nan"), 0, 0)),
        lambda w, b: w.set_wind(3.0),
        lambda w, b: w.set_wind((0, 0, 2e4)),
        lambda w, b: w.set_wind((1, 0, 0), density=-1.0),
        lambda w, b: w.set_wind((1, 0, 0), drag="much"),
        lambda w, b: b.set_sheltered(1),
    ],
)
def test_a_refused_wind_leaves_the_old_one(windy, wrong):
    world, cube, _ = windy
    momenta = []
    for call in (None, wrong):
        cube.set_motion(cube.mesh.vertices, np.zeros((27, 3)))
        world.set_wind((0, 3.0, 0))
        if call is not None:
            with pytest.raises(OptionError):
                call(world, cube)
        world.step(1 / 1500, 1)
        momenta.append(cube.momentum().tolist())
    assert momenta[0] == momenta[1]
    assert momenta[0][1] > 0
