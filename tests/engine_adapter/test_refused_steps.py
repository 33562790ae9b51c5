"""If a game's callback refuses a step, the step is skipped and the world stays unchanged, bit by bit."""

import numpy as np
import pytest

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    ContactBegan,
    Event,
    Material,
    OptionError,
    Released,
    SoftBodyAsset,
    SphereShape,
    box,
)
from taichi_soft.world.bare import bare_world

pytestmark = [pytest.mark.soak, pytest.mark.guard]

JELLY = Material(4e4, 0.3, 600.0, 4.0)
COARSE, FINE = (box((0.4, 0.4, 0.4), cells=(n, n, n)) for n in (1, 3))
CRATE = SoftBodyAsset(FINE, JELLY, coarser=(SoftBodyAsset(COARSE, JELLY),))
STEP = FixedStep(1 / 60, 20)
COUNT = 4


class RefusedError(Exception):
    """Error that the game's callback raises."""


def refuse(*_):
    raise RefusedError


class Later:
    """A force field that is valid for the first bodies and invalid afterwards."""

    def __init__(self, last):
        self.calls, self.last = 0, last

    def __call__(self, positions, time):
        self.calls += 1
        return self.last(positions, time) if self.calls % COUNT == 0 else np.ones_like(positions)


FIELDS = {
    "raises": refuse,
    "raises late": Later(refuse),
    "nan": lambda x, t: np.full_like(x, np.nan),
    "nan late": Later(lambda x, t: np.full_like(x, np.nan)),
    "fewer": lambda x, t: x[:-1],
    "nothing": lambda x, t: None,
    "too strong": lambda x, t: np.full_like(x, 1e20),
}


@pytest.fixture(scope="module", params=["leapfrog", "implicit_euler"])
def game(request):
    """Four crates with levels of detail, two of which fall onto a sphere and a third."""
    world = bare_world(soft_contact=True, sleep_speed=0.05, integrator=request.param, record=8)
    world.add_collider(SphereShape(0.3))
    world.reserve(CRATE, COUNT)
    world.build()
    for place in ((0, 0, 0.6), (0.1, 0, 1.1), (3, 0, 0.2), (6, 0, 0.5)):
        world.spawn(CRATE, position=place)
    world.record_events([Event])
    for _ in range(12):
        world.step(STEP.dt, STEP.substeps)
    return world, world.snapshot()


def adapters(world):
    """Return adapters by name: a plain adapter, and one whose budget reduces detail in every step."""
    plain = EngineAdapter(world, STEP, rewind_ticks=3)
    hasty = EngineAdapter(world, STEP, rewind_ticks=3, budget_ms=1e-6)
    return {"plain": plain, "budget": hasty}


def steps(world, adapter):
    return {
        "World.step": lambda: world.step(STEP.dt, STEP.substeps),
        "EngineAdapter.step": adapter.step,
        "EngineAdapter.advance": lambda: adapter.advance(STEP.dt),
    }


def begin(game):
    world, data = game
    world.set_force_field(None)
    world.restore(data)
    world.drain_events()
    world.bodies[2].set_level(1, release=True)
    world.bodies[2].set_level(0, release=True)
    return world


def all_of(world):
    events = world._built.events
    return (
        world.state_hash(),
        world.snapshot(),
        world.step_count,
        world.time,
        world.restore_count,
        [body.level for body in world.bodies],
        list(events._waiting),
        len(world._handles.recorder._present.entries),
    )


@pytest.mark.parametrize("kind", ["plain", "budget"])
@pytest.mark.parametrize("how", ["World.step", "EngineAdapter.step", "EngineAdapter.advance"])
def test_a_refused_force_field_changes_nothing(game, kind, how):
    """The next step is as if the refused call had not happened.

    With a budget, a coarser level is chosen again.
    """
    for field in FIELDS.values():
        world = begin(game)
        adapter = adapters(world)[kind]
        for _ in range(3):
            adapter.step()
        step = steps(world, adapter)[how]
        before, kept = all_of(world), adapter._rollback.steps
        world.set_force_field(field)
        for _ in range(2):
            with pytest.raises((RefusedError, OptionError)):
                step()
            assert all_of(world) == before
            assert adapter._rollback.steps == kept
        world.set_force_field(None)
        levels = [body.level for body in world.bodies]
        adapter.step()
        assert world.step_count == before[2] + 1
        if kind == "budget":
            assert [body.level for body in world.bodies] != levels
        adapter.rewind(2)


def test_a_world_goes_on_after_refused_steps_as_one_that_was_never_asked(game):
    hashes = []
    for is_refused in (False, True):
        world = begin(game)
        adapter = EngineAdapter(world, STEP)
        for _ in range(5):
            if is_refused:
                world.set_force_field(refuse)
                with pytest.raises(RefusedError):
                    adapter.step()
                world.set_force_field(None)
            adapter.step()
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("budget_ms", [None, 1e-6])
def test_a_before_step_that_raises_stops_the_step_and_only_its_own_deeds_stay(game, budget_ms):
    world = begin(game)
    calls = []

    def third(world):
        calls.append(world.step_count)
        if len(calls) == 3:
            refuse()

    adapter = EngineAdapter(world, STEP, before_step=third, budget_ms=budget_ms)
    adapter.step()
    adapter.step()
    before = all_of(world)
    with pytest.raises(RefusedError):
        adapter.step()
    assert all_of(world) == before

    def push_and_refuse(world):
        world.bodies[3].apply_impulse((0, 0, 1))
        refuse()

    adapter = EngineAdapter(world, STEP, before_step=push_and_refuse, budget_ms=budget_ms)
    with pytest.raises(RefusedError):
        adapter.step()
    after = all_of(world)
    world.restore(before[1])
    world.bodies[3].apply_impulse((0, 0, 1))
    assert world.state_hash() == after[0]


def test_of_several_steps_in_a_frame_those_before_the_refused_one_are_made(game):
    world = begin(game)
    calls, after = [], []

    def third(world):
        calls.append(world.step_count)
        after.append(world.state_hash())
        if len(calls) == 3:
            refuse()

    adapter = EngineAdapter(world, STEP, before_step=third)
    with pytest.raises(RefusedError):
        adapter.advance(5 * STEP.dt)
    assert world.state_hash() == after[-1]
    assert world.step_count == calls[0] + 2
    assert adapter.dropped_time == pytest.approx(3 * STEP.dt)


def test_a_listener_that_raises_changes_nothing_and_no_event_is_lost(game):
    """Listeners are called between steps: the step is made, and stays made."""
    world = begin(game)
    world.drain_events()
    heard = []
    listeners = [world.on(Event, refuse), world.on(Event, heard.append)]
    world.bodies[0].teleport((0, 0, 2))
    for _ in range(60):
        world.step(STEP.dt, STEP.substeps)
    before = world.state_hash(), world.step_count
    with pytest.raises(RefusedError):
        world.drain_events()
    assert (world.state_hash(), world.step_count) == before
    assert world.drain_events() == heard
    assert any(isinstance(event, ContactBegan) for event in heard)
    for each in listeners:
        each.remove()


def test_what_waits_of_the_coming_step_is_kept_where_a_step_is_refused(game):
    """A joint that a change of level releases has its event, even if the step is refused."""
    world = begin(game)
    adapter = EngineAdapter(world, STEP, budget_ms=1e-6)
    adapter.step()
    body = world.bodies[3]
    joint = body.attach_to(world.bodies[2], [0], onto=[0])
    body.set_level(1 - body.level, release=True)
    assert not joint.is_attached
    world.set_force_field(refuse)
    with pytest.raises(RefusedError):
        adapter.step()
    assert [event.handles for event in world.drain_events() if isinstance(event, Released)] == [(joint,)]
