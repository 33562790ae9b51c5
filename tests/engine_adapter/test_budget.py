"""A budget of milliseconds: what is far gets coarser where steps take too long, and finer when there is time.

The clock is ours: a step takes as long as the tetrahedra that are in the world say.
"""

import warnings
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from engine_adapter import EngineAdapter, FixedStep
from taichi_soft import Body, Material, OptionError, SoftBodyAsset, StateError, World

KIND = SoftBodyAsset.from_surface(
    trimesh.creation.icosphere(subdivisions=3, radius=0.4), Material(1e5, 0.4, 1000.0), cells=(6, 4, 3)
)
SIZES = [len(level.mesh.tets) for level in KIND.levels]
COUNT = 6
EYE = np.array([-10.0, 0.0, 0.5])


class Clock:
    """Advances by the cost of a step with each pair of looks: `per_tet` for each tetrahedron, some of them
    interrupted by others."""

    def __init__(self):
        self.world, self.per_tet, self.now, self.is_second = None, 1e-6, 0.0, False
        self.rng = np.random.default_rng(4)
        self.steps = []

    def __call__(self):
        if self.is_second:
            cost = self.per_tet * sum(len(body.tets) for body in self.world.bodies)
            self.steps.append(cost)
            self.now += cost * (1 + 0.03 * self.rng.random()) + (5e-3 if self.rng.random() < 0.03 else 0.0)
        self.is_second = not self.is_second
        return self.now


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr("engine_adapter.adapter.perf_counter", made)
    return made


def row_of(clock, count=COUNT, **options):
    """Balls in a row on the floor, the first nearest to the eye."""
    world = World()
    world.reserve(KIND, count)
    bodies = [world.spawn(KIND, position=(2.0 * i, 0.0, 0.41)) for i in range(count)]
    world.build()
    clock.world = world
    game = EngineAdapter(world, FixedStep(dt=1 / 60), **options)
    return game, bodies


def levels(bodies):
    return [body.level for body in bodies]


def test_twice_the_load_that_fits_comes_inside_the_budget_the_farthest_coarser_first(clock):
    budget = 1e3 * clock.per_tet * COUNT * SIZES[0] / 2
    game, bodies = row_of(clock, budget_ms=budget)
    game.see_from(EYE)
    for _ in range(200):
        game.step()
    late = [cost for cost in clock.steps[10:] if cost > 1e-3 * budget]
    assert not late
    found = levels(bodies)
    assert found == sorted(found)
    assert found[0] < found[-1]
    assert game.given_up.levels == {body: body.level for body in bodies if body.level}
    assert game.given_up.is_met


def test_levels_stand_still_once_the_budget_is_met(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2)
    for _ in range(100):
        game.step()
    seen = set()
    for _ in range(300):
        game.step()
        seen.add(tuple(levels(bodies)))
    assert len(seen) == 1


def test_detail_comes_back_the_nearest_first_when_there_is_time(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2)
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
    assert game.given_up.levels == {}


def test_what_moves_away_is_lowered_in_place_of_what_came_near(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2)
    game.see_from(-EYE + np.array([20.0, 0.0, 0.0]))
    for _ in range(60):
        game.step()
    found = levels(bodies)
    assert found == sorted(found, reverse=True)


def test_a_budget_that_cannot_be_met_is_told(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[2] / 2)
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2] * COUNT
    assert not game.given_up.is_met
    assert game.given_up.step_ms == pytest.approx(1e3 * clock.per_tet * COUNT * SIZES[2], rel=0.05)


def test_what_is_held_keeps_its_level(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[2] / 2)
    hold = bodies[2].attach([0], game.world.add_frame(position=(0, 0, 0)))
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2, 2, 0, 2, 2, 2]
    hold.release()
    for _ in range(10):
        game.step()
    assert levels(bodies) == [2] * COUNT


def test_steps_that_are_made_again_get_the_levels_that_they_had(clock):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2, rewind_ticks=30)
    hashes = []
    for _ in range(20):
        game.step()
        hashes.append((game.state_hash(), levels(bodies)))
    assert len({tuple(each) for _, each in hashes}) > 1
    game.rewind(19)
    clock.per_tet *= 100  # the machine has become slow: that must not matter
    for expected in hashes[1:]:
        game.step()
        assert (game.state_hash(), levels(bodies)) == expected


def test_steps_that_are_made_again_with_other_inputs_leave_what_is_held_then(clock):
    held = []

    def before_step(world):
        if held and world.step_count == 2:
            held.append(world.bodies[-1].attach([0], world.add_frame(position=(0, 0, 0))))

    game, bodies = row_of(
        clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2, rewind_ticks=30, before_step=before_step
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
    for ask in (lambda: game.given_up, lambda: game.see_from(EYE)):
        with pytest.raises(StateError, match="budget_ms"):
            ask()


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "4", True])
def test_a_bad_budget_and_a_bad_place_are_refused(clock, value):
    with pytest.raises(OptionError, match="budget_ms"):
        row_of(clock, 1, budget_ms=value)
    game, _ = row_of(clock, 1, budget_ms=5.0)
    with pytest.raises(OptionError, match="viewer"):
        game.see_from((0.0, np.nan, 0.0))


def test_frozen_bodies_and_bodies_without_levels_are_left_alone(clock):
    world = World(retries=0)
    plain = SoftBodyAsset(KIND.mesh, KIND.material)
    world.reserve(KIND, 1)
    world.reserve(plain, 1)
    one, other = world.spawn(KIND, position=(0, 0, 0.5)), world.spawn(plain, position=(3, 0, 0.5))
    world.build()
    clock.world = world
    far = KIND.mesh.vertices * np.array([40.0, 0.02, 30.0])
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
    assert not game.given_up.is_met


def test_changes_that_take_long_are_spread_over_frames(clock, monkeypatch):
    budget = 1e3 * clock.per_tet * COUNT * SIZES[0] / 2
    moments = iter(np.arange(1e4) * 1e-3 * budget)  # each look at the clock a whole budget after the last
    monkeypatch.setattr("engine_adapter.budget.perf_counter", lambda: next(moments))
    game, bodies = row_of(clock, budget_ms=budget)
    seen = [levels(bodies)]
    for _ in range(40):
        game.step()
        seen.append(levels(bodies))
    at_once = [sum(abs(np.subtract(one, other))) for one, other in pairwise(seen)]
    assert max(at_once) == 1
    assert game.given_up.is_met


def test_where_nothing_can_be_done_it_is_looked_now_and_then_only(clock, monkeypatch):
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[0] / 2)
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
    game, bodies = row_of(clock, budget_ms=1e3 * clock.per_tet * COUNT * SIZES[2] / 2)
    for _ in range(60):
        game.step()
    assert levels(bodies) == [2, 2, 0, 2, 2, 2]
