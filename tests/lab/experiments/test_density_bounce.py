"""A block whose density increases to the right bounces."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Result, Results, Verdict, section_of
from lab.experiments.density_bounce import DT, block, density_of, side

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["density-bounce"]


@pytest.fixture(scope="module")
def rows():
    return list(quick_results(EXPERIMENT.name).rows)


def finding_of(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding


def test_each_side_is_pressed_as_a_bar_of_its_density_that_hits_a_wall(rows):
    """The strain behind the wave from the wall is v / c, c = sqrt(E / rho), by one-dimensional elasticity."""
    grows = Results(tuple(rows)).one(density="grows")
    speed = np.sqrt(2 * 9.81 * 3.0)
    for end, density in (("left", 200.0), ("right", 2000.0)):
        assert side(grows, end)["pressed"] == pytest.approx(speed / np.sqrt(4e5 / density), rel=0.25)


def test_it_falls_as_a_stone_and_rises_lower_than_it_fell(rows):
    for row in rows:
        touched = np.argmax(np.array(row.numbers["left_height"]) < 1e-3)
        assert (touched + 1) * DT == pytest.approx(np.sqrt(2 * 3.0 / 9.81), abs=0.02)
        assert 0 < side(row.numbers, "right")["rises"] < 3.0


def test_with_one_density_both_sides_do_the_same(rows):
    even = Results(tuple(rows)).one(density="mean")
    left, right = side(even, "left"), side(even, "right")
    assert left == pytest.approx(right, rel=0.02)


def test_both_bodies_have_the_same_mass():
    mesh = block(4)
    masses = [density_of(mesh, kind) @ mesh.volumes for kind in ("grows", "mean")]
    assert masses == pytest.approx([1100.0 * 6.75] * 2)


def test_the_verdict_follows_the_numbers_and_there_are_pictures(rows):
    assert finding_of(rows).verdict is Verdict.AGREES
    assert len(section_of(EXPERIMENT, Results(tuple(rows))).pictures) == 4
    swapped = {key.replace("left", "?").replace("right", "left").replace("?", "right"): value
               for key, value in rows[0].numbers.items()}  # fmt: skip
    finding = finding_of([Result(rows[0].point, swapped), rows[1]])
    assert finding.verdict is Verdict.DIFFERS
    assert "not pressed most, nor last, nor least" in finding.why
