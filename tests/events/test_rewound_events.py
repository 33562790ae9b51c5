"""Events of a world with undone steps are equal to those of a world without undone steps."""

import json

import pytest

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import (
    ContactBegan,
    ContactEnded,
    FellAsleep,
    Material,
    SnapshotError,
    SoftBodyAsset,
    StressExceeded,
    TearCandidates,
    Woke,
    box,
)
from taichi_soft.core.container import seal, unseal
from taichi_soft.persistence.snapshot import MARK, VERSION
from taichi_soft.world.bare import bare_world

DT, STEPS, TICKS = 1 / 60, 12, 150
BLOCK = box((0.4, 0.4, 0.4), cells=(2, 2, 2))
BOUNCY, DULL = (SoftBodyAsset(BLOCK, Material(1e5, 0.2, 1000.0, damping)) for damping in (1.0, 300.0))


class Game:
    """Bodies that bounce on each other and on the floor, come to rest, are woken, come and go."""

    def __init__(self):
        world = self.world = bare_world(soft_contact=True, collider_room=1, sleep_speed=0.05)
        world.reserve(BOUNCY, 3)
        world.reserve(DULL, 1)
        world.build()
        world.record_events()
        self.low = world.spawn(BOUNCY, position=(0, 0, 0.6))
        self.high = world.spawn(BOUNCY, position=(0.05, 0, 1.4))
        self.heavy = world.spawn(DULL, position=(2, 0, 0.2))
        self.adapter = EngineAdapter(
            world, FixedStep(dt=DT, substeps=STEPS), before_step=self.act, rewind_ticks=20
        )
        self.is_wrong = False
        self.start = world.snapshot()

    def act(self, world):
        """Perform the inputs of a step: the right inputs, or the wrong inputs that are later replaced."""
        tick = world.step_count
        if self.is_wrong:
            if tick % 3 == 0:
                world.apply_radial_impulse((0, 0, 0), 60.0, 3.0)
            if tick > 20 and self.low.is_alive:
                self.low.watch_stress(1.0)
            if tick % 20 == 6 and self.low.is_alive:
                world.despawn(self.low)
        elif tick == 10:
            self.low.watch_stress(2e3)
            self.high.watch_tearing(3e3)
        elif tick == 90:
            self.heavy.apply_impulse((0, 0, 60.0))
        elif tick == 120:
            world.despawn(self.high)
        elif tick == 126:
            world.spawn(BOUNCY, position=(-2, 0, 0.2))

    def play(self, undone=0, ticks=TICKS):
        """The events of all ticks from the start, as they stand at the end.

        Before each tenth tick so many more are made with wrong inputs, and undone."""
        world = self.world
        world.restore(self.start)
        self.adapter = EngineAdapter(
            world, FixedStep(dt=DT, substeps=STEPS), before_step=self.act, rewind_ticks=20
        )
        self.low.watch_stress(None)
        self.high.watch_tearing(None)
        for tick in range(ticks):
            if undone and tick % 10 == 0:
                self.is_wrong = True
                for _ in range(undone):
                    self.adapter.step()
                self.is_wrong = False
                self.adapter.rewind(undone)
            self.adapter.step()
        return [written(event) for event in world.drain_events()]


def written(event):
    """Return all contents of an event."""
    found = [event.step, event.time, type(event).__name__]
    if isinstance(event, (ContactBegan, ContactEnded)):
        found += [event.a.index, type(event.b).__name__, event.b.index, event.impulse.tolist()]
        return [*found, event.duration] if isinstance(event, ContactEnded) else found
    if isinstance(event, (StressExceeded, TearCandidates)):
        return [*found, event.body.index, event.tetrahedra.tolist(), event.stress.tolist()]
    return [*found, event.body.index]


@pytest.fixture(scope="module")
def game():
    return Game()


@pytest.fixture(scope="module")
def straight(game):
    """Return the events of a run without undone steps."""
    events = game.play()
    kinds = [each[2] for each in events]
    for kind in (ContactBegan, ContactEnded, StressExceeded, TearCandidates, FellAsleep, Woke):
        assert kind.__name__ in kinds
    return events


@pytest.mark.parametrize("undone", [1, 7, 18])
def test_a_run_with_undone_steps_tells_the_same_as_one_without(game, straight, undone):
    assert game.play(undone) == straight


def test_events_drained_in_every_frame_come_again_with_the_steps_that_are_made_again(game, straight):
    game.play(ticks=40)
    told = [each for each in straight if each[0] < 40]
    for _ in range(5):
        game.adapter.step()
        told += map(written, game.world.drain_events())
    game.adapter.rewind(3)
    told = [each for each in told if each[0] < 42]
    while game.world.step_count < 60:
        game.adapter.step()
        told += map(written, game.world.drain_events())
    assert told == [each for each in straight if each[0] < 60]


def test_a_game_that_is_loaded_goes_on_with_what_went_on(game, straight):
    game.play(ticks=50)
    data = game.world.snapshot()
    game.play(ticks=10)
    game.world.restore(data)
    while game.world.step_count < TICKS:
        game.adapter.step()
    events = [written(event) for event in game.world.drain_events()]
    assert events == [each for each in straight if each[0] >= 50]


def test_a_state_of_a_world_that_recorded_nothing_is_where_recording_begins(game):
    game.world.record_events([])
    game.play(ticks=20)
    data = game.world.snapshot()
    game.world.record_events([ContactBegan, FellAsleep, Woke])
    game.world.step(DT, STEPS)
    expected = [written(event) for event in game.world.drain_events()]
    assert "ContactBegan" in [each[2] for each in expected]
    game.world.restore(data)
    game.world.step(DT, STEPS)
    assert [written(event) for event in game.world.drain_events()] == expected
    game.world.record_events()


def test_the_name_of_a_state_does_not_depend_on_who_listens(game):
    game.play(ticks=50)
    names = {game.world.state_hash()}
    data = game.world.snapshot()
    game.world.record_events([])
    names.add(game.world.state_hash())
    game.world.restore(data)
    names.add(game.world.state_hash())
    game.world.record_events()
    assert len(names) == 1


def test_what_is_no_memory_of_events_is_refused_and_changes_nothing(game):
    world = game.world
    game.play(ticks=50)
    before = world.snapshot()
    *parts, memory = map(bytes, unseal(before, MARK, VERSION, "snapshot"))
    sound = json.loads(memory)
    contacts = sound["contacts"]
    for change in (
        {"status": [0]},
        {"status": [9, 0, 0, 0]},
        {"status": "x"},
        {"contacts": {**contacts, "shape": [-1, 1]}},
        {"contacts": [[float("nan")] * 11]},
        {"contacts": 3},
        {"watches": [["Event", 1, 1.0, ""]]},
        {"watches": [["StressExceeded", 1, 1.0, "0"]]},
        {"watches": [1]},
    ):
        bad = json.dumps({**sound, **change}).encode()
        with pytest.raises(SnapshotError):
            world.restore(seal(MARK, VERSION, [*parts, bad]))
    for bad in (b"", b"3", b"{}", json.dumps({**sound, "status": None, "contacts": None}).encode()[:-1]):
        with pytest.raises(SnapshotError):
            world.restore(seal(MARK, VERSION, [*parts, bad]))
    assert world.snapshot() == before
