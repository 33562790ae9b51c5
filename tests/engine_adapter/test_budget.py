"""A budget in milliseconds: distant bodies become coarser or skip steps if steps take too long.

They become finer if there is time.

The tests have their own clock. The duration of a step is proportional to the number of moving tetrahedra.
"""

import warnings
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Body, Material, OptionError, SoftBodyAsset, StateError
from taichi_soft.world.bare import bare_world

COUNT = 6
EYE = np.array([-10.0, 0.0, 0.5])
DRIFT = np.array([0.0, 0.1, 0.0])  # [m/s]: who stands still skips steps


@cache
def kind():
    """Return a ball with three levels. It is not made while tests are only collected."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.4)
    return SoftBodyAsset.from_surface(ball, Material(1e5, 0.4, 1000.0), cells=(6, 4, 3))


def size(level):
    """Return the number of tetrahedra of a ball."""
    return len(kind().levels[level].mesh.tets)


class Clock:
    """Clock that advances by the cost of a step between its two calls in each step.

    The cost is `per_tet` for each tetrahedron that moves. Some steps take longer at random.
    """

    def __init__(self):
        self.world, self.per_tet, self.now, self.is_second = None, 1e-6, 0.0, False
        self.rng = np.random.default_rng(4)
        self.steps, self.skipped, self.places = [], [], {}

    def __call__(self):
        places = {body: body.positions() for body in self.world.bodies}
        if self.is_second:
            stood = {body for body, x in places.items() if np.array_equal(x, self.places[body])}
            cost = self.per_tet * sum(len(body.tets) for body in self.world.bodies if body not in stood)
            cost += 1e-9
            self.steps.append(cost)
            self.skipped.append({body.index for body in stood})
            self.now += cost * (1 + 0.03 * self.rng.random()) + (5e-3 if self.rng.random() < 0.03 else 0.0)
        self.is_second, self.places = not self.is_second, places
        return self.now


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr("engine_adapter.adapter.perf_counter", made)
    return made


def row_of(clock, count=COUNT, apart=2.0, soft_contact=False, **options):
    """Make a row of balls that drift side by side. The first is nearest to the eye."""
    world = bare_world(gravity=(0, 0, 0), floor=None, soft_contact=soft_contact)
    world.reserve(kind(), count)
    bodies = [world.spawn(kind(), position=(apart * i, 0.0, 0.4), velocity=DRIFT) for i in range(count)]
    world.build()
    clock.world = world
    game = EngineAdapter(world, FixedStep(dt=1 / 60), **options)
    return game, bodies


def levels(bodies):
    return [body.level for body in bodies]


def test_twice_the_load_that_fits_comes_inside_the_budget_the_farthest_coarser_first(clock):
    budget = 1e3 * clock.per_tet * COUNT * size(0) / 2
    game, bodies = row_of(clock, budget_ms=budget)
    game.see_from(EYE)
    for _ in range(200):
        game.step()
    late = [cost for cost in clock.steps[10:] if cost > 1e-3 * budget]
    assert not late
    found = levels(bodies)
    assert found == sorted(found)
    assert found[0] < found[-1]
    assert game.budget_status.levels == {body: body.level for body in bodies if body.level}
    assert game.budget_status.is_met


def test_levels_stand_still_once_the_budget_is_met(clock, monkeypatch):
    # A change of level must take no time. On a busy machine it would delay the next changes.
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: clock.now)
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(0) / 2)
    for _ in range(100):
        game.step()
    seen = set()
    for _ in range(300):
        game.step()
        seen.add(tuple(levels(bodies)))
    assert len(seen) == 1


def test_detail_comes_back_the_nearest_first_when_there_is_time(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(0) / 2)
    game.see_from(EYE)
    for _ in range(60):
        game.step()
    coarse = levels(bodies)
    clock.per_tet /= 10
    seen = []
    for _ in range(600):
        game.step()
        seen.append(levels(bodies))
    assert all(each == sorted(each) for each in seen)
    assert sum(coarse) > 0
    assert seen[-1] == [0] * COUNT
    assert game.budget_status.levels == {}


def test_what_moves_away_is_lowered_in_place_of_what_came_near(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(0) / 2)
    game.see_from(-EYE + np.array([20.0, 0.0, 0.0]))
    for _ in range(60):
        game.step()
    found = levels(bodies)
    assert found == sorted(found, reverse=True)


def test_a_budget_that_cannot_be_met_is_told(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * size(2) / 2)
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2] * COUNT
    assert not game.budget_status.is_met
    assert game.budget_status.step_ms == pytest.approx(1e3 * clock.steps[-1], rel=0.05)
    assert_moves_at_least_at_a_quarter(clock.skipped)


def assert_moves_at_least_at_a_quarter(skipped):
    """Assert that every body makes at least one of four successive steps. The nearest makes all steps."""
    for at in range(len(skipped) - 3):
        assert not set.intersection(*skipped[at : at + 4])
    assert not any(0 in each for each in skipped)


def test_the_farthest_skip_steps_where_all_are_as_coarse_as_can_be(clock, monkeypatch):
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: 0.0)  # deciding takes no time
    budget = 1e3 * clock.per_tet * COUNT * size(2)
    game, bodies = row_of(clock, budget_ms=budget)
    game.see_from(EYE)
    for _ in range(100):
        game.step()
    assert levels(bodies) == [2] * COUNT
    settled = clock.skipped[40:]
    skippers = set.union(*settled)
    assert skippers == set(range(COUNT - len(skippers), COUNT))
    assert len(skippers) <= 4
    assert max(clock.steps[40:]) < 1e-3 * budget
    assert_moves_at_least_at_a_quarter(settled)
    assert game.budget_status.skipping == tuple(bodies[i] for i in sorted(skippers, reverse=True))
    assert game.budget_status.is_met


def test_steps_fit_at_once_while_levels_change_one_by_one(clock, monkeypatch):
    budget = 1e3 * clock.per_tet * COUNT * size(0) / 2
    moments = iter(np.arange(1e4) * 0.3e-3 * budget)
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: next(moments))
    game, _ = row_of(clock, budget_ms=budget)
    game.see_from(EYE)
    for _ in range(60):
        game.step()
    assert max(clock.steps[1:]) < 1.001e-3 * budget
    assert clock.skipped[1]
    assert not any(clock.skipped[30:])
    assert game.budget_status.skipping == ()


def test_skipping_ends_before_any_level_is_raised(clock, monkeypatch):
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: 0.0)  # deciding takes no time
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(2) * 0.85)
    game.see_from(EYE)
    for _ in range(100):
        game.step()
    coarse, count = levels(bodies), len(clock.skipped)
    assert any(clock.skipped[-4:])
    clock.per_tet /= 20
    found = []
    for _ in range(400):
        game.step()
        found.append(levels(bodies))
    raised = next(k for k, each in enumerate(found) if each != coarse)
    assert not any(clock.skipped[count + raised - 29 :])
    assert found[-1] == [0] * COUNT


def test_bodies_that_touch_skip_steps_together(clock):
    budget = 1e3 * clock.per_tet * 4 * size(2) * 0.85
    game, bodies = row_of(clock, 4, 3.0, True, budget_ms=budget)
    game.see_from(EYE)
    x = bodies[2].positions()
    bodies[2].set_motion(x - x.mean(axis=0) + bodies[3].center_of_mass() - (0.78, 0, 0), DRIFT + 0 * x)
    for _ in range(60):
        game.step()
    assert game.world.islands == [(bodies[0],), (bodies[1],), (bodies[2], bodies[3])]
    settled = clock.skipped[30:]
    assert any({2, 3} <= each for each in settled)
    assert all((2 in each) == (3 in each) for each in settled)
    assert_moves_at_least_at_a_quarter(settled)


def test_what_is_held_keeps_its_level(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(2) / 2)
    hold = bodies[2].grab(0)
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2, 2, 0, 2, 2, 2]
    assert bodies[2] not in game.budget_status.skipping
    hold.release()
    for _ in range(10):
        game.step()
    assert levels(bodies) == [2] * COUNT


@pytest.mark.parametrize(("level", "part"), [(0, 0.5), (2, 0.85)])
def test_steps_that_are_made_again_get_the_levels_that_they_had(clock, level, part):
    budget = COUNT * size(level) * part
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * budget, rewind_ticks=30)
    hashes = []
    for _ in range(20):
        game.step()
        hashes.append((game.state_hash(), levels(bodies)))
    assert len({tuple(each) for _, each in hashes}) > 1
    skipped = clock.skipped[1:]
    assert any(skipped)
    game.rewind(19)
    clock.per_tet *= 100  # the machine becomes slow, which must have no effect
    for expected in hashes[1:]:
        game.step()
        assert (game.state_hash(), levels(bodies)) == expected
    assert clock.skipped[20:] == skipped


def test_steps_that_are_made_again_with_other_inputs_leave_what_is_held_then(clock):
    held = []

    def before_step(world):
        if held and world.step_count == 2:
            held.append(world.bodies[-1].grab(0))

    game, bodies = row_of(
        clock, budget_ms=1e3 * clock.per_tet * COUNT * size(0) / 2, rewind_ticks=30, before_step=before_step
    )
    while bodies[-1].level < 2:
        game.step()
    game.rewind(game.world.step_count)
    held.append(None)
    for _ in range(10):
        game.step()
    assert bodies[-1].level < 2


def test_without_a_budget_nothing_changes_and_asking_is_refused(clock):
    game, bodies = row_of(clock, 2)
    clock.per_tet *= 1e6
    for _ in range(10):
        game.step()
    assert levels(bodies) == [0, 0]
    for ask in (lambda: game.budget_status, lambda: game.see_from(EYE)):
        with pytest.raises(StateError, match="budget_ms"):
            ask()


def test_the_old_name_of_the_status_works_with_a_warning(clock):
    game, _ = row_of(clock, 2, budget_ms=1e6)
    with pytest.warns(DeprecationWarning, match="budget_status"):
        assert game.given_up == game.budget_status


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "4", True])
def test_a_bad_budget_and_a_bad_place_are_refused(clock, value):
    with pytest.raises(OptionError, match="budget_ms"):
        row_of(clock, 1, budget_ms=value)
    game, _ = row_of(clock, 1, budget_ms=5.0)
    with pytest.raises(OptionError, match="viewer"):
        game.see_from((0.0, np.nan, 0.0))


def test_frozen_bodies_and_bodies_without_levels_are_left_alone(clock):
    world = bare_world(retries=0)
    plain = SoftBodyAsset(kind().mesh, kind().material)
    world.reserve(kind(), 1)
    world.reserve(plain, 1)
    one, other = world.spawn(kind(), position=(0, 0, 0.5)), world.spawn(plain, position=(3, 0, 0.5))
    world.build()
    clock.world = world
    far = kind().mesh.vertices * np.array([40.0, 0.02, 30.0])
    one.set_motion(far, 1e3 * np.random.default_rng(0).normal(size=far.shape))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        world.step(0.5, substeps=1)
    assert one.is_frozen
    game = EngineAdapter(world, FixedStep(1 / 60, substeps=4), budget_ms=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # how far from each other its vertices are is no matter here
        for _ in range(10):
            game.step()
    assert (one.level, other.level) == (0, 0)
    assert not game.budget_status.is_met


def test_changes_that_take_long_are_spread_over_frames(clock, monkeypatch):
    budget = 1e3 * clock.per_tet * COUNT * size(0) / 2
    moments = iter(np.arange(1e4) * 1e-3 * budget)  # each look at the clock a whole budget after the last
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: next(moments))
    game, bodies = row_of(clock, budget_ms=budget)
    seen = [levels(bodies)]
    for _ in range(40):
        game.step()
        seen.append(levels(bodies))
    at_once = [sum(abs(np.subtract(one, other))) for one, other in pairwise(seen)]
    assert max(at_once) == 1
    assert game.budget_status.is_met


def test_where_nothing_can_be_done_it_is_looked_now_and_then_only(clock, monkeypatch):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(0) / 2)
    game.see_from(EYE)
    for _ in range(100):
        game.step()
    assert max(levels(bodies)) > 0
    looks = []
    center_of_mass = Body.center_of_mass
    monkeypatch.setattr(Body, "center_of_mass", lambda body: looks.append(body) or center_of_mass(body))
    for _ in range(90):
        game.step()
    assert 0 < len(looks) <= 4 * COUNT


def test_who_sleeps_is_not_woken_to_be_coarser(clock, monkeypatch):
    monkeypatch.setattr(Body, "is_asleep", property(lambda body: body.index == 2))
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * size(2) / 2)
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2, 2, 0, 2, 2, 2]
