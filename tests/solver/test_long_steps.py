"""Steps that take long are made in several calls of a kernel: the same motion, and Ctrl-C ends them."""

import signal
import threading

import numpy as np
import pytest

from taichi_soft import Material, box, sphere
from taichi_soft.solver import schedules
from taichi_soft.world.bare import bare_world

pytestmark = pytest.mark.soak

BALL, CUBE = sphere(0.3, 3), box((0.5,) * 3, (3, 3, 3))
MATERIAL = Material(3e5, 0.3, 500.0)
OPTIONS = {
    "alone": {},
    "flat": {"schedule": "flat"},
    "contact": {"soft_contact": True},
    "implicit": {"integrator": "implicit_euler"},
    "implicit contact": {"integrator": "implicit_euler", "soft_contact": True},
}


def fallen(options):
    """Make a heap, and a cube so deformed that its steps fail and are retried."""
    world = bare_world(**options)
    for i in range(3):
        world.add_body(CUBE if i % 2 else BALL, MATERIAL, position=(0.1 * i, 0.05 * i, 0.5 + 0.6 * i))
    torn = world.add_body(CUBE, MATERIAL, position=(3, 0, 1))
    world.build()
    noise = 60.0 * np.random.default_rng(0).normal(size=CUBE.vertices.shape)
    torn.set_motion(torn.positions(), noise)
    for _ in range(20):
        world.step(1 / 60)
    return world


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.parametrize("stretch", [1, 3000])
def test_a_step_in_pieces_is_the_step_bit_for_bit(name, stretch, monkeypatch):
    whole = fallen(OPTIONS[name]).state_hash()
    monkeypatch.setattr(schedules, "MAX_CALL_WORK", stretch)
    assert fallen(OPTIONS[name]).state_hash() == whole


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timer that raises")
@pytest.mark.skipif(threading.current_thread() is not threading.main_thread(), reason="which hears Ctrl-C")
@pytest.mark.parametrize("name", ["alone", "flat", "contact"])
def test_ctrl_c_ends_a_long_step_and_the_world_is_as_before(name):
    """Like Ctrl-C, a signal raises KeyboardInterrupt as soon as Python runs again."""
    world = bare_world(**OPTIONS[name])
    body = world.add_body(sphere(0.3, 6), MATERIAL, position=(0, 0, 0.5))
    hand = world.add_frame((0, 0, 1))
    world.build()
    body.attach([0, 1, 2], hand)
    if name != "flat":
        world.set_force_field(lambda positions, time: np.full(positions.shape, (0.0, 2.0, 0.0)))
    for _ in range(3):
        world.step(1 / 60)
    hand.move_to((0, 0, 1.2))
    body.apply_impulse((3.0, 0.0, 0.0))
    before, time = world.state_hash(), world.time
    handler = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            world.step(1 / 60, 1_000_000)  # about a minute's work
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
    assert (world.state_hash(), world.time) == (before, time)
    data = world.snapshot()
    world.step(1 / 60)
    after = world.state_hash()
    world.restore(data)
    world.step(1 / 60)
    assert world.state_hash() == after
    assert body.center_of_mass()[0] > 1e-4  # the impulse that waited


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timer that raises")
@pytest.mark.skipif(threading.current_thread() is not threading.main_thread(), reason="which hears Ctrl-C")
def test_ctrl_c_lets_a_short_step_end(monkeypatch):
    """The world is then in the state after an uninterrupted step."""
    monkeypatch.setattr(schedules, "MAX_CALL_WORK", 10**9)

    def stepped():
        world = bare_world()
        world.add_body(sphere(0.3, 6), MATERIAL, position=(0, 0, 0.5))
        world.build()
        world.step(1 / 60)
        return world

    whole, ended = stepped(), stepped()
    whole.step(1 / 60, 4000)
    handlers = signal.SIGALRM, signal.SIGINT
    before = [signal.signal(each, signal.default_int_handler) for each in handlers]
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises(KeyboardInterrupt):
            ended.step(1 / 60, 4000)  # a quarter of a second
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for each, handler in zip(handlers, before, strict=True):
            signal.signal(each, handler)
    assert (ended.state_hash(), ended.time) == (whole.state_hash(), whole.time)
