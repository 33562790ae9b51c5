"""Late inputs: steps are undone and repeated. `test_threads.py` checks that the results are equal."""

import numpy as np
import pytest
from random_play import DT, SUBSTEPS, act, make_world

from engine_adapter import EngineAdapter, FixedStep, Rollback
from taichi_soft import OptionError, StateError
from taichi_soft.world.bare import bare_world


@pytest.fixture(scope="module")
def game():
    return make_world()


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
        with pytest.raises(OptionError, match="is not stored"):
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
        Rollback(bare_world(), 3)
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
    # The state precedes the inputs of the first step, so that other inputs can replace them.
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
    with pytest.raises(OptionError, match="is not stored"):
        adapter.rewind(3)
    with pytest.raises(StateError, match="rewind_ticks"):
        EngineAdapter(world).rewind(1)


def test_a_loaded_game_is_no_past_of_what_a_ring_has_kept(game):
    """A loaded state leads to none of the ring's states until it is itself stored in the ring."""
    world, _ = game
    adapter = EngineAdapter(world, FixedStep(dt=DT, substeps=SUBSTEPS), rewind_ticks=8)
    adapter.advance(2.4 * DT)
    data, loaded = adapter.snapshot(), adapter.state_hash()
    for _ in range(4):
        world.bodies[0].apply_impulse((0, 0, 20))
        adapter.step()
    world.restore(data)  # behind the adapter's back
    with pytest.raises(OptionError, match="restored"):
        adapter.rewind(1)
    adapter.step()
    with pytest.raises(OptionError, match="is not stored"):
        adapter.rewind(1)
    after = adapter.state_hash()
    adapter.step()
    adapter.rewind(1)
    assert adapter.state_hash() == after
    adapter.advance(0.5 * DT)
    adapter.restore(data)
    assert (adapter.state_hash(), adapter.alpha) == (loaded, 0.0)
    with pytest.raises(OptionError, match="is not stored"):
        adapter.rewind(1)
    adapter.step()
    assert adapter.state_hash() == after
    adapter.rewind(1)
    assert adapter.state_hash() == loaded


def test_the_ring_of_another_notices_that_steps_were_taken_back(game):
    world, _ = game
    ours, theirs = Rollback(world, 5), Rollback(world, 5)
    for _ in range(3):
        ours.save()
        theirs.save()
        world.step(DT, SUBSTEPS)
    ours.rewind_to(world.step_count - 2)
    assert len(ours.steps) == 2
    assert theirs.steps == ()
    with pytest.raises(OptionError, match="restored"):
        theirs.rewind_to(world.step_count)
    theirs.save()
    assert theirs.steps == (world.step_count,)
