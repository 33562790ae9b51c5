"""Impulses, velocities and teleports between steps: exact momentum, and no change after a refusal."""

import numpy as np
import pytest

from taichi_soft import Material, OptionError, StateError, box, sphere
from taichi_soft.world.bare import bare_world

NAN, INF = float("nan"), float("inf")
SCHEDULES = ("per_body", "flat", "implicit")


def make(schedule, **options):
    """A soft cube that is deformed and turning, a ball beside it, no gravity."""
    integrator = "implicit_euler" if schedule == "implicit" else "leapfrog"
    world = bare_world(
        # The floor is far below. It lets all tests share kernels.
        **{"gravity": (0, 0, 0), "floor": -1e3, **options},
        integrator=integrator,
        schedule="per_body" if schedule == "implicit" else schedule,
    )
    cube = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 1))
    ball = world.add_body(sphere(0.5, 3), Material(1e5, 0.2, 100.0, 2.0), position=(0, 2, 1), pinned=[0])
    world.build()
    return world, cube, ball


@pytest.fixture(scope="module")
def worlds():
    return {schedule: make(schedule) for schedule in SCHEDULES}


@pytest.fixture
def start():
    """Puts cube and ball back: a shear of the cube and random speeds, the same each time."""

    def put(world, cube, ball):
        random = np.random.default_rng(5)
        shear = np.array([[1, 0.1, 0], [0, 1, 0.05], [0, 0, 0.9]])
        for body, place in ((cube, (0, 0, 1)), (ball, (0, 2, 1))):
            body.set_motion(
                body.mesh.vertices @ shear.T + place, random.normal(size=(body.vertex_count, 3)) * 0.2
            )
        return world, cube, ball

    return put


@pytest.fixture(params=SCHEDULES)
def moving(request, worlds, start):
    return start(*worlds[request.param])


@pytest.fixture
def plain(worlds, start):
    return start(*worlds["per_body"])


def state_of(world):
    return [(b.positions().tobytes(), b.velocities().tobytes(), b.pinned.tobytes()) for b in world.bodies]


def test_an_impulse_is_the_change_of_momentum(moving):
    world, cube, _ = moving
    for _ in range(3):
        world.step(1 / 60, 8)
    before = cube.momentum()
    cube.apply_impulse((300.0, -20.0, 50.0))
    np.testing.assert_allclose(cube.momentum() - before, (300, -20, 50), atol=3e-3)
    for _ in range(3):
        world.step(1 / 60, 8)
    np.testing.assert_allclose(cube.momentum() - before, (300, -20, 50), atol=2e-2)


def test_an_impulse_changes_all_velocities_named_by_the_same(plain):
    _, cube, ball = plain
    others = ball.velocities().tobytes()
    before = cube.velocities()
    cube.apply_impulse((30.0, 0.0, -60.0), [3, 17, 5])
    change = np.zeros((27, 3))
    change[[3, 5, 17]] = np.array([30.0, 0, -60]) / cube.masses[[3, 5, 17]].sum()
    np.testing.assert_allclose(cube.velocities() - before, change, atol=1e-5)
    assert ball.velocities().tobytes() == others


def test_what_falls_to_pinned_particles_does_not_move_them(plain):
    _, _, ball = plain
    before = ball.velocities()
    ball.apply_impulse((0.0, 7.0, 0.0))
    speed = 7.0 / ball.masses.sum()
    change = ball.velocities() - before
    np.testing.assert_array_equal(change[0], 0.0)
    np.testing.assert_allclose(change[1:], np.tile([0, speed, 0], (ball.vertex_count - 1, 1)), atol=1e-5)


def test_an_impulse_at_a_point_is_whole_and_falls_off_to_the_radius(moving):
    _, cube, _ = moving
    x, before = cube.positions().astype(float), cube.velocities().astype(float)
    point, impulse, radius = np.array([0.4, 0.1, 1.3]), np.array([10.0, 40.0, -5.0]), 0.7
    cube.apply_impulse_at_point(impulse, point, radius)
    change = cube.velocities() - before
    distance = np.linalg.norm(x - point, axis=1)
    weight = np.where(distance < radius, (1 - (distance / radius) ** 2) ** 2, 0)
    assert 2 <= (weight > 0).sum() < len(x)
    np.testing.assert_allclose(change, np.outer(weight / (cube.masses @ weight), impulse), atol=2e-5)
    np.testing.assert_allclose(cube.masses @ change, impulse, atol=2e-3)
    moment = np.cross(x, cube.masses[:, None] * change).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross(x, np.outer(cube.masses * weight, impulse)).sum(axis=0)
                               / (cube.masses @ weight), atol=5e-3)  # fmt: skip


def test_a_point_that_is_far_from_the_body_is_refused_with_the_distance(moving):
    world, cube, _ = moving
    before = state_of(world)
    nearest = np.linalg.norm(cube.positions().astype(float) - [3, 0, 1], axis=1).min()
    with pytest.raises(OptionError, match=f"{nearest:.3g}.* m .*body 0"):
        cube.apply_impulse_at_point((1, 0, 0), (3, 0, 1), 0.9 * nearest)
    assert state_of(world) == before


def test_a_radial_impulse_pushes_each_particle_away_by_its_bodys_share(moving):
    world, *bodies = moving
    x = [body.positions().astype(float) for body in bodies]
    before = [body.velocities().astype(float) for body in bodies]
    center, impulse, radius = np.array([0.2, 0.9, 0.8]), 50.0, 1.6
    world.apply_radial_impulse(center, impulse, radius)
    for body, place, v in zip(bodies, x, before, strict=True):
        away = place - center
        r = np.linalg.norm(away, axis=1)
        falloff = np.where(r < radius, (1 - (r / radius) ** 2) ** 2, 0)
        expected = impulse / body.masses.sum() * (falloff / r)[:, None] * away
        expected[body.pinned] = 0
        np.testing.assert_allclose(body.velocities() - v, expected, atol=1e-5)
        assert np.abs(expected).max() > 0.01


def test_a_radial_impulse_at_the_middle_of_a_ball_moves_its_centre_nowhere(plain):
    world, cube, _ = plain
    cube.set_motion(cube.mesh.vertices + np.array([0, 0, 1]), np.zeros((27, 3)))
    world.apply_radial_impulse((0, 0, 1), 100.0, 2.0)
    v = cube.velocities()
    assert np.linalg.norm(v, axis=1).max() > 0.05
    np.testing.assert_allclose(cube.momentum(), 0, atol=1e-4)
    np.testing.assert_allclose(cube.angular_momentum(), 0, atol=1e-4)
    mirrored = np.argmin(
        np.linalg.norm(cube.mesh.vertices[:, None] + cube.mesh.vertices[None], axis=2), axis=1
    )
    np.testing.assert_allclose(v[mirrored], -v, atol=1e-6)


def test_set_velocity_makes_a_rigid_motion(moving):
    world, cube, ball = moving
    world.step(1 / 60, 8)
    linear, angular = np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.0, -2.0])
    for body in (cube, ball):
        body.set_velocity(linear, angular)
        x = body.positions().astype(float)
        expected = linear + np.cross(angular, x - body.masses @ x / body.masses.sum())
        expected[body.pinned] = 0
        np.testing.assert_allclose(body.velocities()[body.pinned], 0, atol=1e-7)
        if not len(body.pinned):
            np.testing.assert_allclose(body.velocities(), expected, atol=3e-6)
            np.testing.assert_allclose(body.momentum(), body.masses.sum() * linear, atol=1e-2)


@pytest.mark.parametrize("keep", [True, False])
def test_a_jump_is_rigid_and_keeps_the_deformation(moving, turned, keep):
    world, cube, ball = moving
    world.step(1 / 60, 8)
    world.step(1 / 60, 8)
    x, v, other = cube.positions().astype(float), cube.velocities(), ball.positions().tobytes()
    halfway = world.read_positions(cube, 0.5).astype(float)
    center, target = cube.center_of_mass(), np.array([4.0, -3.0, 7.0])
    cube.teleport(target, turned, keep_velocity=keep)
    np.testing.assert_allclose(cube.positions(), (x - center) @ turned.T + target, atol=2e-6)
    np.testing.assert_allclose(
        world.read_positions(cube, 0.5), (halfway - center) @ turned.T + target, atol=2e-6
    )
    if keep:
        np.testing.assert_allclose(cube.velocities(), v @ turned.T, atol=2e-3)
    else:
        raw = cube.velocities() if world.settings.integrator.value != "leapfrog" else None
        assert raw is None or not raw.any()
    assert ball.positions().tobytes() == other


def test_a_jump_leaves_energy_and_spin_as_they_were(plain, turned):
    """Two worlds apart by a rigid motion tell the same story."""
    world, cube, _ = plain
    stories = []
    for place, turn in (((0.0, 0.0, 1.0), None), ((2.0, 0.0, 3.0), turned)):
        cube.set_motion(cube.mesh.vertices * [1, 1, 0.9] + [0, 0, 1], np.zeros((27, 3)))
        cube.set_velocity((1, 0, 0), (0, 3, 0))
        cube.teleport(place, turn)
        for _ in range(10):
            world.step(1 / 60, 8)
        rotation = np.eye(3) if turn is None else turn
        stories.append((cube.positions() - cube.center_of_mass()) @ rotation)
    np.testing.assert_allclose(stories[0], stories[1], atol=2e-5)


def test_a_jump_below_the_floor_is_refused_but_not_one_onto_it(solo, cube, jelly):
    world, body = solo(cube, jelly, position=(0, 0, 2))
    before = state_of(world)
    with pytest.raises(OptionError, match=r"0\.3 m below the floor"):
        body.teleport((0, 0, 0.2))
    with pytest.raises(OptionError, match=r"beyond 1e\+07 m"):
        body.teleport((9.9999999e6, 0, 2))
    assert state_of(world) == before
    body.teleport((0, 0, 0.5))
    assert body.positions()[:, 2].min() == pytest.approx(0, abs=1e-6)


BAD_CALLS = {
    "impulse NaN": lambda w, b: b.apply_impulse((NAN, 0, 0)),
    "impulse text": lambda w, b: b.apply_impulse("up"),
    "impulse shape": lambda w, b: b.apply_impulse((1, 2)),
    "impulse throws": lambda w, b: b.apply_impulse((1e9, 0, 0)),
    "no particle": lambda w, b: b.apply_impulse((1, 0, 0), []),
    "particle out of range": lambda w, b: b.apply_impulse((1, 0, 0), [27]),
    "particle below zero": lambda w, b: b.apply_impulse((1, 0, 0), [-1]),
    "particle mask": lambda w, b: b.apply_impulse((1, 0, 0), [True, False]),
    "point inf": lambda w, b: b.apply_impulse_at_point((1, 0, 0), (INF, 0, 0), 1.0),
    "radius zero": lambda w, b: b.apply_impulse_at_point((1, 0, 0), (0, 0, 1), 0.0),
    "radius negative": lambda w, b: b.apply_impulse_at_point((1, 0, 0), (0, 0, 1), -1.0),
    "radius vector": lambda w, b: b.apply_impulse_at_point((1, 0, 0), (0, 0, 1), (1, 1, 1)),
    "point throws": lambda w, b: b.apply_impulse_at_point((1e12, 0, 0), (0, 0, 1), 1.0),
    "radial vector": lambda w, b: w.apply_radial_impulse((0, 0, 0), (1, 0, 0), 1.0),
    "radial NaN": lambda w, b: w.apply_radial_impulse((0, 0, NAN), 1.0, 1.0),
    "radial no radius": lambda w, b: w.apply_radial_impulse((0, 0, 0), 1.0, 0.0),
    "radial throws": lambda w, b: w.apply_radial_impulse((0, 0, 0), -1e9, 1.0),
    "velocity NaN": lambda w, b: b.set_velocity((0, NAN, 0)),
    "velocity of a shell": lambda w, b: b.set_velocity((2e4, 0, 0)),
    "spin of a bomb": lambda w, b: b.set_velocity((0, 0, 0), (0, 0, 1e6)),
    "jump nowhere": lambda w, b: b.teleport((NAN, 0, 0)),
    "jump mirrored": lambda w, b: b.teleport((0, 0, 3), np.diag([1, 1, -1])),
    "jump long quaternion": lambda w, b: b.teleport((0, 0, 3), (0, 0, 0, 2)),
    "jump keeps 1": lambda w, b: b.teleport((0, 0, 3), keep_velocity=1),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_refused_call_changes_nothing(plain, name):
    world, cube, _ = plain
    before = state_of(world)
    with pytest.raises(OptionError):
        BAD_CALLS[name](world, cube)
    assert state_of(world) == before


def test_nothing_can_be_pushed_before_build(cube, jelly):
    world = bare_world()
    body = world.add_body(cube, jelly, position=(0, 0, 2))
    for call in (
        lambda: body.apply_impulse((1, 0, 0)),
        lambda: body.apply_impulse_at_point((1, 0, 0), (0, 0, 2), 1.0),
        lambda: body.set_velocity((1, 0, 0)),
        lambda: body.teleport((0, 0, 3)),
        lambda: body.pin([0]),
        lambda: body.unpin(),
        lambda: world.apply_radial_impulse((0, 0, 0), 1.0, 1.0),
    ):
        with pytest.raises(StateError, match="not built"):
            call()
