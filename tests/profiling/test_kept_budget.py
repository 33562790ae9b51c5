"""What is told of a budget follows from the steps that were taken. No time is asserted."""

import pytest
import trimesh

from taichi_soft import Material, SoftBodyAsset
from taichi_soft.profiling import kept_budget, measure_kept_budget
from taichi_soft.profiling.kept_budget import Course, first_met, tell
from taichi_soft.profiling.profile_tables import tables
from taichi_soft.profiling.spread import Spread

pytestmark = pytest.mark.soak

FACTS = {"is_kept": True, "is_fixed": False, "tets": 7, "frozen": 0, "stolen": None, "skipped": 0.0}
FACTS["work"] = Spread.of([1.0])


@pytest.mark.parametrize(
    ("steps", "met_after"),
    [
        ([2.0] * 5 + [1.0] * 20, 5),
        ([1.0] * 20, 0),
        ([2.0] * 30, None),
        ([2.0] * 12 + [0.9] * 9, None),  # too few to tell
        ([1.0] + [2.0] * 9 + [1.0] * 10, 10),  # a single step within the budget is not enough
        ([2.0] * 3 + [1.0] * 4 + [9.0] + [1.0] * 10, 3),  # a single interrupted step is ignored
    ],
)
def test_a_budget_is_met_from_the_first_step_that_fits_with_those_after_it(steps, met_after):
    assert first_met(steps, 1.0) == met_after


def test_frames_are_told_by_whether_a_level_changed_in_them():
    steps = [4.0, 2.0] + [1.0] * 18
    frames = [each + extra for each, extra in zip(steps, [3.0, 0.5, 7.0] + [0.25] * 17, strict=True)]
    levels = [(0, 0), (0, 1), (0, 1), (1, 1), *[(1, 1)] * 17]
    run = tell(Course(steps, frames, levels), 1.5, **FACTS)
    assert (run.changing.least, run.changing.most, run.frames_with_changes) == (3.0, 7.0, 2)
    assert (run.deciding.least, run.deciding.most) == (0.25, 0.5)
    assert (run.step.most, run.frame.most, run.settled.most) == (4.0, 8.0, 1.0)
    assert (run.late, run.late_settled, run.met_after) == (0.1, 0.0, 2)
    assert run.levels == {1: 2}


def test_a_run_that_never_meets_its_budget_is_told_as_a_whole():
    run = tell(Course([3.0] * 20, [3.5] * 20, [(2,)] * 21), 1.5, **FACTS)
    assert (run.met_after, run.late, run.late_settled) == (None, 1.0, 1.0)
    assert run.settled == run.step
    assert run.changing is None


@pytest.mark.guard
def test_the_budget_is_half_of_what_the_same_bodies_take_without_one(monkeypatch):
    def kinds():
        ball = trimesh.creation.icosphere(subdivisions=2, radius=0.4)
        return [SoftBodyAsset.from_surface(ball, Material(1e5, 0.4, 1000.0), cells=(5, 3))]

    monkeypatch.setattr(kept_budget, "_kinds", kinds)
    monkeypatch.setattr(kept_budget, "ROWS", 2)
    monkeypatch.setattr(kept_budget, "SETTLING", 2)
    without, kept, fixed = runs = measure_kept_budget(12)
    assert [(run.is_kept, run.is_fixed) for run in runs] == [(False, False), (True, False), (False, True)]
    assert without.budget == kept.budget == fixed.budget == pytest.approx(without.step.median / 2)
    assert (fixed.levels_in_order, fixed.tets) == (kept.levels_in_order, kept.tets)
    assert (without.skipped, fixed.skipped) == (0.0, 0.0)
    assert 0.0 <= kept.skipped <= 0.75
    assert without.levels == {0: 4}
    assert sum(kept.levels.values()) == 4
    assert kept.tets <= without.tets
    assert without.frozen == kept.frozen == 0
    for run in runs:
        assert run.frame.most >= run.step.most > 0.0
        assert run.work.most > 0.0
        assert run.frames_with_changes == 0 or run.is_kept
    ((title, table),) = tables({"kept_budget": runs})
    assert "4 bodies with levels of detail" in title
    assert [column.header for column in table.columns] == ["", "without", "with a budget", "its levels"]
