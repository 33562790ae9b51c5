"""Late inputs: steps taken back and made again, against a world in which nothing ever went wrong."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from random_play import DT, SUBSTEPS, act, check, make_world

from engine_adapter import EngineAdapter, FixedStep, Rollback
from taichi_soft import OptionError, StateError, World


@pytest.fixture(scope="module")
def straight():
    """300 ticks with wrong inputs taken back every 20: hashes of a straight run, and how many differ."""
    return check(300, seed=11)


@pytest.fixture(scope="module")
def game():
    return make_world()


def test_every_tick_made_again_is_the_same(straight):
    hashes, different = straight
    assert different == 0
    assert len(set(hashes)) == 300


def test_another_number_of_threads_gives_the_same_hashes(straight):
    script = Path(__file__).with_name("random_play.py")
    command = [sys.executable, str(script), "--ticks", "100", "--seed", "11", "--threads", "1"]
    out = subprocess.run(command, check=True, capture_output=True, text=True, timeout=500).stdout
    assert f"0 hashes differ after rollback; the last is {straight[0][99]};" in out


def test_a_ring_keeps_the_last_ticks_and_goes_back_to_any(game):
    world, cube = game
    rollback = Rollback(world, ticks=5)
    first = world.step_count
    assert rollback.steps == ()
    before = {}
    for _ in range(9):
        rollback.save()
        before[world.step_count] = world.state_hash()
        act(world, cube, 3)
        world.step(DT, SUBSTEPS)
    assert rollback.steps == tuple(range(first + 3, first + 9))
    rollback.rewind_to(first + 6)
    assert world.step_count == first + 6
    assert world.state_hash() == before[first + 6]
    assert rollback.steps == tuple(range(first + 3, first + 7))
    for step in (first + 2, first + 7, first + 100):
        with pytest.raises(OptionError, match="not kept"):
            rollback.rewind_to(step)
    assert world.state_hash() == before[first + 6]
    rollback.rewind_to(first + 4)
    assert world.state_hash() == before[first + 4]


def test_bad_rings_are_refused(game):
    world, _ = game
    for bad in (0, -1, 2.5, True):
        with pytest.raises(OptionError):
            Rollback(world, bad)
    with pytest.raises(OptionError, match="World"):
        Rollback("world", 3)
    with pytest.raises(StateError, match="build"):
        Rollback(World(), 3)
    with pytest.raises(OptionError, match="none yet"):
        Rollback(world, 3).rewind_to(0)


def test_an_adapter_rewinds_and_draws_the_same_pictures(game):
    world, _ = game
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=SUBSTEPS), rewind_ticks=8)
    adapter.advance(2.4 * DT)
    assert np.isclose(adapter.alpha, 0.4)
    pictures = [adapter.positions(body) for body in world.bodies]
    adapter.rewind(2)
    assert np.isclose(adapter.alpha, 0.4)
    # The inputs of the first step are not in it yet, so that others can take their place.
    world.bodies[0].apply_impulse((0, 0, 50))
    adapter.step()
    adapter.step()
    other = [adapter.positions(body) for body in world.bodies]
    assert (other[0] != pictures[0]).any()
    adapter.rewind(2)
    adapter.step()
    adapter.step()
    again = [adapter.positions(body) for body in world.bodies]
    assert all((a == b).all() for a, b in zip(pictures, again, strict=True))
    with pytest.raises(OptionError, match="not kept"):
        adapter.rewind(3)
    with pytest.raises(StateError, match="rewind_ticks"):
        EngineAdapter(world).rewind(1)
