"""Several bodies in one world, worlds one after another, and one after the other's end."""

import gc
import warnings

import numpy as np
import pytest

from taichi_soft import Material, StateError, beam, box, sphere
from taichi_soft.bodies import fields as states
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

# mesh, material, options: everything in which bodies can differ.
KINDS = {
    "cube": (box(cells=(2, 2, 2)), Material(1e5, 0.2, 1000.0, 20.0), {}),
    "ball": (
        sphere(0.5, 3),
        Material(2e5, 0.4, 500.0, 10.0),
        {"law": "face", "strain": "exact", "flips": "recover"},
    ),
    "beam": (
        beam(2.0, 0.5, 0.5, 2),
        Material(np.linspace(1e5, 3e5, len(beam(2.0, 0.5, 0.5, 2).tets)), -0.2, 800.0, 5.0),
        {"damping_model": "tet_mean", "flips": "off"},
    ),
}


def fall(names, schedule="per_body", steps=60, floor=0.0):
    """Positions and velocities of each body after they fell and hit the floor."""
    gc.collect()
    world = bare_world(schedule=schedule, floor=floor)
    for name in names:
        mesh, material, options = KINDS[name]
        place = (3.0 * list(KINDS).index(name), 1.0, 0.9)
        tilt = (0.0, np.sin(0.2), 0.0, np.cos(0.2))
        world.add_body(mesh, material, **options, position=place, rotation=tilt, velocity=(0, 1, -1))
    world.build()
    for _ in range(steps):
        world.step(1 / 60, 8)
    assert all(body.failure is None for body in world.bodies)
    return {
        name: (body.positions(), body.velocities()) for name, body in zip(names, world.bodies, strict=True)
    }


@pytest.fixture(scope="module")
def together():
    return fall(list(KINDS))


@pytest.mark.guard
@pytest.mark.parametrize("name", KINDS)
def test_a_body_among_others_moves_as_if_alone(together, name):
    """The motion is equal bit by bit, for any materials of the other bodies."""
    alone = fall([name])
    assert together[name][0].tobytes() == alone[name][0].tobytes()
    assert together[name][1].tobytes() == alone[name][1].tobytes()


def test_a_second_run_has_the_same_bits(together):
    again = fall(list(KINDS))
    for name in KINDS:
        assert again[name][0].tobytes() == together[name][0].tobytes()
        assert again[name][1].tobytes() == together[name][1].tobytes()


def test_both_schedules_tell_the_same_story(together):
    """The bodies have two models: each block of tetrahedra must use its own model."""
    names = ["cube", "beam"]
    flat, per_body = (fall(names, schedule, steps=10, floor=None) for schedule in ("flat", "per_body"))
    for name in names:
        np.testing.assert_allclose(flat[name][0], per_body[name][0], atol=1e-4)
        np.testing.assert_allclose(flat[name][1], per_body[name][1], atol=1e-2)


def test_two_worlds_do_not_disturb_each_other(solo, cube, jelly):
    lone, lone_body = solo(cube, jelly, position=(0, 0, 0.7))
    for _ in range(40):
        lone.step(1 / 60, 8)
    expected = lone_body.positions().tobytes()
    first, first_body = solo(cube, jelly, position=(0, 0, 0.7))
    second, second_body = solo(cube, jelly, {"gravity": (0, 0, 3.0)}, position=(1, 0, 0.7))
    for _ in range(40):
        first.step(1 / 60, 8)
        second.step(1 / 30, 16)
    assert first_body.positions().tobytes() == expected
    assert second_body.center_of_mass()[2] == pytest.approx(0.7 + 1.5 * (40 / 30) ** 2, rel=1e-3)


@pytest.fixture
def no_states(monkeypatch):
    """Remove the fields that other tests have left."""
    monkeypatch.setattr(states, "_free", [])


@pytest.mark.usefixtures("no_states")
def test_a_state_is_reused_and_clean(jelly):
    """The world that was there before was larger, broken, elsewhere and had another floor."""

    def run(world, body):
        for _ in range(30):
            world.step(1 / 60, 8)
        return body.positions().tobytes()

    def small():
        world = bare_world()
        body = world.add_body(box(cells=(2, 2, 2)), jelly, position=(0, 0, 0.6), velocity=(0.5, 0, 0))
        world.build()
        return world, body

    first, body = small()
    expected = run(first, body)

    previous = bare_world(gravity=(0, 0, 5.0), floor=3.0, restitution=1.0, friction=0.0, retries=0)
    broken = previous.add_body(box(cells=(3, 3, 3)), Material(1e9, 0.2, 1000.0, 20.0), position=(0, 0, 4))
    previous.add_body(box(cells=(3, 3, 3)), jelly, position=(2, 0, 4))
    previous.build()
    with warnings.catch_warnings(record=True):
        for _ in range(20):
            previous.step(1 / 60, 2)
    assert broken.is_frozen
    state = previous._built.state
    del previous, broken
    gc.collect()

    world, body = small()
    assert world._built.state is state
    assert run(world, body) == expected


@pytest.mark.usefixtures("no_states")
def test_a_world_that_is_dropped_gives_its_state_back_at_once(cube, jelly):
    """Without waiting for the garbage collector; its bodies say so."""

    def make():
        world = bare_world()
        body = world.add_body(cube, jelly, position=(0, 0, 5.0))
        world.build()
        return world._built.state, body

    gc.disable()
    try:
        state, body = make()
        other, _ = make()
    finally:
        gc.enable()
    assert other is state
    with pytest.raises(StateError, match=r"world.*body 0.*keep a reference"):
        body.positions()


def test_bodies_come_in_the_order_of_adding(cube, jelly):
    world = bare_world()
    bodies = [world.add_body(cube, jelly, position=(2 * i, 0, 1)) for i in range(9)]
    assert list(world.bodies) == bodies
    assert [body.index for body in bodies] == list(range(9))
    world.build()
    for i, body in enumerate(bodies):
        assert body.center_of_mass()[0] == pytest.approx(2 * i, abs=1e-5)


def test_set_motion_starts_afresh(solo, cube, jelly):
    """A body that is reset to its start repeats its first motion."""
    world, body = solo(cube, jelly, position=(0, 0, 0.6), velocity=(1, 0, 0))
    start, speed = body.positions(), body.velocities()
    runs = []
    for _ in range(2):
        body.set_motion(start, speed)
        for _ in range(40):
            world.step(1 / 60, 8)
        runs.append(body.positions().tobytes())
    assert runs[0] == runs[1]
