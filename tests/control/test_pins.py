"""Pins at run time, and particles that the caller moves."""

import numpy as np
import pytest

from taichi_soft import Material, OptionError, StateError, box
from taichi_soft.world.bare import bare_world

TOP = np.flatnonzero(box(cells=(2, 2, 2)).vertices[:, 2] > 0.4)
NAN = float("nan")
KINDS = ("leapfrog", "leapfrog flat", "lazy_leapfrog", "implicit")


def make(kind):
    """A cube on its way down, well above the floor."""
    world = bare_world(
        integrator="implicit_euler" if kind == "implicit" else kind.removesuffix(" flat"),
        schedule="flat" if kind.endswith("flat") else "per_body",
    )
    body = world.add_body(box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), position=(0, 0, 5))
    world.build()
    return world, body


@pytest.fixture(scope="module")
def made():
    return {kind: make(kind) for kind in KINDS}


@pytest.fixture(params=["leapfrog", *(pytest.param(kind, marks=pytest.mark.soak) for kind in KINDS[1:])])
def falling(request, made):
    world, body = made[request.param]
    body.unpin()
    body.set_motion(body.mesh.vertices + np.array([0, 0, 5]), np.tile([0.5, 0, 0], (27, 1)))
    world.step(1 / 60, 8)
    return world, body


@pytest.fixture
def plain(made):
    world, body = made["leapfrog"]
    body.unpin()
    body.set_motion(body.mesh.vertices + np.array([0, 0, 5]), np.zeros((27, 3)))
    return world, body


def test_what_is_pinned_in_flight_stays_where_it_is(falling):
    world, body = falling
    held = body.positions()[TOP]
    body.pin(TOP)
    assert body.pinned.tolist() == TOP.tolist()
    for _ in range(20):
        world.step(1 / 60, 8)
    assert body.positions()[TOP].tobytes() == held.tobytes()
    assert not body.velocities()[TOP].any()
    assert body.center_of_mass()[2] < held[:, 2].mean() - 0.5


def test_what_is_let_go_falls_as_it_would_have(falling):
    world, body = falling
    body.pin(range(27))
    world.step(1 / 60, 8)
    body.unpin([1, 2])
    assert body.pinned.tolist() == [0, *range(3, 27)]
    body.unpin()
    assert len(body.pinned) == 0
    z = body.center_of_mass()[2]
    for _ in range(30):
        world.step(1 / 60, 8)
    fallen = 0.5 * 9.81 * 0.5**2
    assert z - body.center_of_mass()[2] == pytest.approx(fallen, abs=0.6 * 9.81 * 0.5 / 480 + 1e-3)


def test_targets_are_reached_on_a_straight_line_and_then_kept(falling):
    world, body = falling
    body.pin(TOP)
    before = body.positions()
    goal = before[TOP] + np.array([0.05, -0.02, 0.03]) + np.random.default_rng(1).normal(size=(9, 3)) * 0.01
    body.set_targets(TOP, goal)
    world.step(1 / 60, 8)
    np.testing.assert_allclose(body.positions()[TOP], goal, atol=3e-6)
    np.testing.assert_allclose(
        world.read_positions(body, 0.25)[TOP], 0.75 * before[TOP] + 0.25 * goal, atol=3e-6
    )
    np.testing.assert_allclose(body.velocities()[TOP], (goal - before[TOP]) * 60, atol=1e-3)
    there = body.positions()[TOP]
    for _ in range(3):
        world.step(1 / 60, 8)
        np.testing.assert_array_equal(body.positions()[TOP], there)
        assert not body.velocities()[TOP].any()


def test_a_path_of_targets_is_followed_without_drift(falling):
    world, body = falling
    body.pin(TOP)
    start = body.positions()[TOP].astype(float)
    for step in range(1, 61):
        angle = 2 * np.pi * step / 60
        offset = 0.3 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
        body.set_targets(TOP[::-1], (start + offset)[::-1])
        world.step(1 / 60, 8)
        np.testing.assert_allclose(body.positions()[TOP], start + offset, atol=3e-6)


def test_what_is_let_go_while_it_is_moved_flies_on(plain):
    """A body thrown by hand keeps the speed of the hand."""
    world, body = plain
    body.pin(range(27))
    for _ in range(3):
        body.set_targets(range(27), body.positions() + np.array([0.02, 0, 0.01]))
        world.step(1 / 60, 8)
    body.unpin()
    np.testing.assert_allclose(body.velocities(), np.tile([1.2, 0, 0.6], (27, 1)), atol=2e-2)
    world.step(1 / 60, 8)
    np.testing.assert_allclose(body.momentum() / body.masses.sum(), [1.2, 0, 0.6 - 9.81 / 60], atol=2e-2)


def test_the_floor_does_not_push_what_is_moved_by_hand(falling):
    world, body = falling
    body.pin(TOP)
    bottom = np.setdiff1d(np.arange(27), TOP)
    body.pin(bottom)
    for _ in range(30):
        body.set_targets(range(27), body.positions() - [0, 0, 0.2])
        world.step(1 / 60, 8)
    assert body.positions()[:, 2].max() < -0.1
    body.unpin()
    body.set_motion(body.mesh.vertices + np.array([0, 0, 5]), np.zeros((27, 3)))


def test_a_pinned_particle_has_no_velocity_of_its_own(solo, cube, jelly):
    """Neither from the start nor from set_motion: it would drift off."""
    world, body = solo(cube, jelly, position=(0, 0, 3), velocity=(1, 0, 0), pinned=[4])
    place = body.positions()[4]
    world.step(1 / 60, 8)
    body.set_motion(body.positions(), np.tile([0, 2, 0], (27, 1)))
    world.step(1 / 60, 8)
    assert body.positions()[4].tobytes() == place.tobytes()


BAD_CALLS = {
    "pin nothing": (lambda b: b.pin([]), OptionError),
    "pin out of range": (lambda b: b.pin([27]), OptionError),
    "pin floats": (lambda b: b.pin([1.5]), OptionError),
    "pin a body": (lambda b: b.pin(b), OptionError),
    "unpin below zero": (lambda b: b.unpin([-3]), OptionError),
    "targets NaN": (lambda b: b.set_targets([0, 1], [[0, 0, NAN], [0, 0, 0]]), OptionError),
    "targets too few": (lambda b: b.set_targets([0, 1], [[0, 0, 0]]), OptionError),
    "targets far": (lambda b: b.set_targets([0], [[0, 0, 1e7]]), OptionError),
    "targets twice": (lambda b: b.set_targets([0, 0], np.zeros((2, 3))), OptionError),
    "targets of loose ones": (lambda b: b.set_targets([0, 5], np.zeros((2, 3))), StateError),
}


@pytest.mark.parametrize("name", BAD_CALLS)
def test_a_refused_call_changes_nothing(plain, name):
    world, body = plain
    body.pin([0, 1])
    call, error = BAD_CALLS[name]
    before = body.positions().tobytes(), body.velocities().tobytes(), body.pinned.tobytes()
    with pytest.raises(error):
        call(body)
    assert (body.positions().tobytes(), body.velocities().tobytes(), body.pinned.tobytes()) == before
    world.step(1 / 60, 8)
    assert body.positions()[[0, 1]].tobytes() == np.frombuffer(before[0], np.float32).reshape(-1, 3)[
        [0, 1]
    ].tobytes()  # fmt: skip


def test_a_loose_particle_is_named(plain):
    _, body = plain
    body.pin([0])
    with pytest.raises(StateError, match=r"vertex 5.*body 0.*not pinned"):
        body.set_targets([0, 5], np.zeros((2, 3)))
