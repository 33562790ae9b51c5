"""Forces during one step, gravity per body, linear damping, force fields: Newton's laws and closed forms."""

import numpy as np
import pytest

from taichi_soft import FrozenBodyWarning, Material, OptionError, StateError, box
from taichi_soft.world.bare import bare_world

NAN = float("nan")
KINDS = ("leapfrog", "lazy_leapfrog", "implicit_euler")


@pytest.fixture(scope="module")
def made():
    """Per integrator a world of two cubes."""
    worlds = {}
    for kind in KINDS:
        world = bare_world(integrator=kind, floor=-1e3)  # far below; the floor lets all tests share kernels
        for i in range(2):
            world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(3 * i, 0, 0))
        world.build()
        worlds[kind] = world
    return worlds


def at_rest(world):
    for i, body in enumerate(world.bodies):
        body.unpin()
        body.set_gravity_scale(0.0)
        body.set_linear_damping(0.0)
        body.set_motion(body.mesh.vertices + np.array([3.0 * i, 0, 0]), np.zeros((27, 3)))
    world.set_force_field(None)
    return world, *world.bodies


@pytest.fixture(params=["leapfrog", pytest.param("lazy_leapfrog", marks=pytest.mark.soak), "implicit_euler"])
def floating(request, made):
    """Two cubes at rest, without gravity."""
    return at_rest(made[request.param])


@pytest.fixture
def plain(made):
    return at_rest(made["leapfrog"])


def state_of(world):
    return [
        (b.positions().tobytes(), b.velocities().tobytes(), b.pinned.tobytes(), b.gravity_scale)
        for b in world.bodies
    ]


@pytest.mark.parametrize(("dt", "substeps"), [(1 / 60, 8), (1 / 60, 7), (0.005, 2)])
def test_a_force_gives_its_impulse_in_one_step_and_is_gone(floating, dt, substeps):
    world, body, other = floating
    for _ in range(3):
        before = body.momentum()
        body.apply_force((600.0, -90.0, 0.0))
        body.apply_force((0.0, 0.0, 45.0), [3, 20])
        world.step(dt, substeps)
        expected = np.array([600.0, -90, 45]) * dt
        # 2e-4 of an implicit solve is its tolerance.
        close = 1e-5 if world.settings.integrator != "implicit_euler" else 2e-4
        np.testing.assert_allclose(body.momentum() - before, expected, atol=close * 10)
        before = body.momentum()
        world.step(dt, substeps)
        np.testing.assert_allclose(body.momentum() - before, 0, atol=close * 10)
    assert other.momentum() == pytest.approx(0, abs=1e-6)


def test_a_force_on_some_particles_accelerates_just_them_at_first(plain):
    world, body, _ = plain
    body.apply_force((0.0, 30.0, 0.0), [0, 1])
    world.step(1e-5, 1)
    expected = np.zeros((27, 3))
    expected[[0, 1], 1] = 1e-5 * 30 / body.masses[[0, 1]].sum()
    np.testing.assert_allclose(body.velocities(), expected, atol=2e-8)


def test_a_couple_of_forces_turns_the_body_and_leaves_its_momentum(plain):
    """dL/dt is the torque."""
    world, body, _ = plain
    right, left = (np.flatnonzero(np.abs(body.mesh.vertices[:, 0] - x) < 1e-9) for x in (0.5, -0.5))
    torque = 0.0
    for _ in range(5):
        x = body.positions().astype(float)
        for side, force in ((right, 40.0), (left, -40.0)):
            body.apply_force((0, force, 0), side)
            torque += force * (body.masses[side] @ x[side, 0]) / body.masses[side].sum()
        world.step(1 / 600, 1)
    np.testing.assert_allclose(body.momentum(), 0, atol=1e-5)
    np.testing.assert_allclose(body.angular_momentum(), [0, 0, torque / 600], atol=2e-4)


def test_a_force_of_the_weight_holds_the_body_up(floating):
    """From the first step on: no creeping of half a substep's fall."""
    world, body, _ = floating
    body.set_gravity_scale(1.0)
    start = body.center_of_mass()
    for _ in range(30):
        body.apply_force((0, 0, 9.81 * body.masses.sum()))
        world.step(1 / 60, 8)
    close = 1e-5 if world.settings.integrator == "leapfrog" else 1e-3
    np.testing.assert_allclose(body.center_of_mass(), start, atol=close)
    np.testing.assert_allclose(body.velocities(), 0, atol=5e-4)


@pytest.mark.parametrize("scale", [0.0, 1.0, -1.0, 2.0, 0.165])
def test_gravity_is_multiplied_for_one_body(floating, scale):
    world, body, other = floating
    body.set_gravity_scale(scale)
    assert body.gravity_scale == pytest.approx(scale)
    for _ in range(30):
        world.step(1 / 60, 8)
    close = 2e-5 if world.settings.integrator == "leapfrog" else 1.1 * abs(scale) * 0.5 * 9.81 * 0.5 / 480
    assert body.center_of_mass()[2] == pytest.approx(-scale * 0.5 * 9.81 * 0.25, abs=close + 2e-5)
    assert body.momentum()[2] / 1000 == pytest.approx(-scale * 9.81 * 0.5, rel=2e-5, abs=1e-6)
    assert body.gravitational_energy() == pytest.approx(
        scale * 9.81 * 1000 * body.center_of_mass()[2], rel=1e-4, abs=1e-2
    )
    assert not other.momentum().any()


@pytest.mark.parametrize("rate", [0.5, 4.0, 300.0])
def test_linear_damping_is_an_exact_exponential(floating, rate):
    world, body, other = floating
    for each in (body, other):
        each.set_velocity((1.0, -2.0, 3.0))
    body.set_linear_damping(rate)
    steps = 20 if rate < 100 else 1
    for _ in range(steps):
        world.step(1 / 60, 8)
    faded = np.exp(-rate * steps / 60)
    np.testing.assert_allclose(body.momentum() / 1000 / faded, (1, -2, 3), rtol=3e-5, atol=2e-4)
    np.testing.assert_allclose(other.momentum() / 1000, (1, -2, 3), rtol=1e-5)


def test_damping_far_stronger_than_a_substep_stops_and_does_not_throw(floating):
    world, body, _ = floating
    body.set_velocity((1.0, 0.0, 0.0), (0, 0, 3.0))
    body.set_linear_damping(1e6)
    world.step(1 / 60, 8)
    assert np.abs(body.velocities()).max() < 1e-3
    assert not body.is_frozen


def test_a_force_field_accelerates_by_place_and_time(floating):
    world, body, other = floating
    t0 = world.time
    asked = []

    def field(x, t):
        asked.append((x.copy(), t))
        return np.stack([np.full(len(x), 2.0), -x[:, 0], np.full(len(x), 10 * (t - t0))], axis=1)

    world.set_force_field(field)
    for step in range(6):
        x = [each.positions() for each in (body, other)]
        before = [each.momentum() for each in (body, other)]
        world.step(1 / 60, 8)
        assert [rows.tobytes() for rows, _ in asked[-2:]] == [rows.tobytes() for rows in x]
        assert asked[-1][1] == pytest.approx(t0 + step / 60)
        for each, place, momentum in zip((body, other), x, before, strict=True):
            expected = [2 * 1000, -(each.masses @ place[:, 0]), 10 * step / 60 * 1000]
            np.testing.assert_allclose(each.momentum() - momentum, np.array(expected) / 60, atol=2e-3)
    world.set_force_field(None)
    before = body.momentum()
    world.step(1 / 60, 8)
    np.testing.assert_allclose(body.momentum(), before, atol=2e-3)
    assert len(asked) == 12


@pytest.mark.parametrize(
    "field",
    [
        lambda x, t: np.full((len(x), 3), NAN),
        lambda x, t: np.zeros((len(x), 2)),
        lambda x, t: None,
        lambda x, t: np.full((len(x), 3), 1e30),
        lambda x, t: 1 / 0,
        lambda x, t: np.zeros((27, 3)) if x[0, 0] < 1 else np.zeros(3),
    ],
)
def test_a_force_field_that_fails_makes_no_step(plain, field):
    world, body, _ = plain
    body.pin([0])
    body.set_targets([0], [[-0.4, -0.5, -0.5]])
    body.apply_force((6, 0, 0), [5])
    before, count = state_of(world), world.step_count
    world.set_force_field(field)
    with pytest.raises((OptionError, ZeroDivisionError)):
        world.step(1 / 60, 8)
    assert (state_of(world), world.step_count) == (before, count)
    world.set_force_field(None)
    world.step(1 / 60, 8)  # with the target and the force still to come
    np.testing.assert_allclose(body.positions()[0], [-0.4, -0.5, -0.5], atol=1e-6)
    assert body.momentum()[0] > 0.05


BAD_CALLS = {
    "force NaN": lambda w, b: b.apply_force((0, NAN, 0)),
    "force shape": lambda w, b: b.apply_force(3.0),
    "force of a star": lambda w, b: b.apply_force((1e15, 0, 0)),
    "force on none": lambda w, b: b.apply_force((1, 0, 0), []),
    "force on vertex 27": lambda w, b: b.apply_force((1, 0, 0), [27]),
    "gravity NaN": lambda w, b: b.set_gravity_scale(NAN),
    "gravity text": lambda w, b: b.set_gravity_scale("none"),
    "gravity vector": lambda w, b: b.set_gravity_scale((0, 0, 1)),
    "damping negative": lambda w, b: b.set_linear_damping(-0.1),
    "damping infinite": lambda w, b: b.set_linear_damping(float("inf")),
    "field that is none": lambda w, b: w.set_force_field((0, 0, 1)),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_refused_call_changes_nothing(plain, name):
    world, body, _ = plain
    before = state_of(world)
    with pytest.raises(OptionError):
        BAD_CALLS[name](world, body)
    world.step(1 / 60, 8)
    assert state_of(world) == before


def test_what_acts_within_substeps_is_refused_under_the_flat_schedule(cube, jelly):
    world = bare_world(schedule="flat")
    body = world.add_body(cube, jelly, position=(0, 0, 2))
    world.build()
    for call in (
        lambda: body.apply_force((1, 0, 0)),
        lambda: body.set_linear_damping(1.0),
        lambda: world.set_wind((1, 0, 0)),
        lambda: world.set_force_field(lambda x, t: x),
        lambda: world.add_motor(body, [0], (0, 0, 1), speed=1.0, max_force=1.0, is_fixed=True),
    ):
        with pytest.raises(StateError, match="schedule='per_body'"):
            call()
    body.set_gravity_scale(0.5)
    for _ in range(10):
        world.step(1 / 60, 8)
    assert body.momentum()[2] / 1000 == pytest.approx(-0.5 * 9.81 / 6, rel=1e-4)


def test_nothing_acts_before_build(cube, jelly):
    world = bare_world()
    body = world.add_body(cube, jelly, position=(0, 0, 2))
    for call in (
        lambda: body.apply_force((1, 0, 0)),
        lambda: body.set_gravity_scale(0.0),
        lambda: body.set_linear_damping(1.0),
        lambda: world.set_wind((1, 0, 0)),
        lambda: world.set_force_field(lambda x, t: x),
        lambda: world.add_motor(body, [0], (0, 0, 1), speed=1.0, max_force=1.0, is_fixed=True),
    ):
        with pytest.raises(StateError, match="not built"):
            call()


def test_a_frozen_body_is_left_alone_by_forces(plain):
    world, body, other = plain
    body.set_velocity((1.9e4, 0, 0))
    body.apply_force((9e8, 0, 0))
    with pytest.warns(FrozenBodyWarning):
        world.step(1 / 60, 8)
    asked = []
    world.set_force_field(lambda x, t: asked.append(len(x)) or np.zeros_like(x))
    before = body.positions().tobytes()
    body.apply_force((5, 0, 0))
    world.step(1 / 60, 8)
    assert body.positions().tobytes() == before
    assert asked == [27]
    assert not other.is_frozen
