"""Figure 6.3 (b): volume and width compared with the closed form of uniform strain."""

from dataclasses import replace

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["fig-6.3b"]


@pytest.fixture(scope="module")
def results():
    return quick_results(EXPERIMENT.name)


def test_with_nu_0_the_volume_grows_with_the_length_alone(results):
    numbers = results.one(poisson=0.0)
    s = np.array(numbers["stretch"])
    np.testing.assert_allclose(numbers["volume"], 1 + s, rtol=1e-7)
    np.testing.assert_allclose(numbers["width"], 1, rtol=1e-7)


@pytest.mark.parametrize("nu", [0.4, -0.4])
def test_half_way_up_the_width_is_that_of_a_free_bar(results, nu):
    """Its strain across is -nu times that along, both linearised as in eq. 6.7; ends are three radii away."""
    numbers = results.one(poisson=nu, strain="linear")
    s = np.array(numbers["stretch"][:2])
    np.testing.assert_allclose(numbers["width"][:2], np.sqrt(1 - nu * (2 * s + s**2)), rtol=0.02)


def test_the_exact_strain_makes_it_less_slim(results):
    numbers = results.one(poisson=0.4, strain="exact")
    s = np.array(numbers["stretch"][:2])
    np.testing.assert_allclose(numbers["width"][:2], 1 - 0.4 * s, rtol=0.02)


def test_what_the_thesis_says_is_found_and_a_picture_is_drawn(results):
    section = section_of(EXPERIMENT, results)
    found = {finding.claim: finding for finding in section.findings}
    assert {claim: each.verdict for claim, each in found.items()} == {
        "cylinder-0.4": Verdict.PARTLY,  # at a quarter of its length, but not as far as it goes
        "cylinder-0": Verdict.AGREES,
        "cylinder-negative": Verdict.AGREES,
    }
    assert "less than 5% counts as kept" in found["cylinder-0.4"].measured
    assert "does not hold for a stretch of" in found["cylinder-0.4"].why
    (picture,) = section.pictures
    assert picture.image.dtype == np.uint8
    assert picture.image.std() > 10


def test_a_volume_that_is_kept_to_the_end_agrees(results):
    rows = [
        replace(row, numbers={**row.numbers, "volume": [1.04] * len(row.numbers["volume"])})
        if row.point["poisson"] == 0.4
        else row
        for row in results.rows
    ]
    first = section_of(EXPERIMENT, Results(tuple(rows))).findings[0]
    assert (first.claim, first.verdict) == ("cylinder-0.4", Verdict.AGREES)


def test_shapes_of_other_nu_give_other_verdicts(results):
    turned = {0.4: 0.0, 0.0: -0.4, -0.4: 0.4}
    rows = [
        replace(row, point={**row.point, "poisson": turned[row.point["poisson"]]})
        for row in results.rows
        if row.point["strain"] == "linear"
    ]
    rows += [row for row in results.rows if row.point["strain"] == "exact"]
    findings = {f.claim: f.verdict for f in section_of(EXPERIMENT, Results(tuple(rows))).findings}
    assert set(findings.values()) == {Verdict.DIFFERS}
