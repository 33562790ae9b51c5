"""Figure 6.4: slopes compared with finite elements, and the curve of nu = 0 with its closed form."""

from dataclasses import replace

import numpy as np
import pytest
from linear_oracle import force_on_top
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from taichi_soft import cylinder

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["fig-6.4"]


@pytest.fixture(scope="module")
def results():
    return quick_results(EXPERIMENT.name)


def curve(results, **values):
    return results.one(**{"young": 1e6, "slide": False, "shaken": False, **values})


@pytest.mark.parametrize("nu", [0.0, 0.2, 0.4])
def test_at_small_strain_forces_are_those_of_finite_elements(results, nu):
    mesh = cylinder(1.0, 0.5, 4, 2)
    for way, axis, direction in (("tension", 2, (0, 0, 1)), ("shear", 0, (1, 0, 0))):
        numbers = curve(results, way=way, poisson=nu)
        wanted = force_on_top(mesh, 1e6, nu, direction)[axis]
        np.testing.assert_allclose(numbers[way][0] / numbers["strain"][0], wanted, rtol=0.01)


def test_with_nu_0_the_tensile_force_is_that_of_even_strain(results):
    numbers = curve(results, way="tension", poisson=0.0)
    s = np.array(numbers["strain"])
    np.testing.assert_allclose(numbers["tension"], 1e6 * numbers["area"] * (s + s**2 / 2), rtol=1e-8)
    assert numbers["area"] == pytest.approx(12 * np.sin(np.pi / 12))  # of 24 corners on a circle of 1 m
    np.testing.assert_allclose(numbers["shear"], 0, atol=1e-3)


def test_sliding_plates_leave_the_whole_contraction(results):
    numbers = curve(results, way="tension", poisson=0.2, slide=True)
    assert numbers["tension"][0] / (1e6 * numbers["area"] * 0.01) == pytest.approx(1, abs=0.01)


def test_an_uneven_mesh_has_another_tension_and_a_little_shear(results):
    """Small beside the tension, but not the round-off of a symmetric mesh."""
    even, uneven = (
        curve(results, way="tension", poisson=0.2, shaken=is_shaken) for is_shaken in (False, True)
    )
    assert uneven["tension"][0] != pytest.approx(even["tension"][0], rel=1e-6)
    sideways = np.hypot(uneven["shear"], uneven["aside"]) / uneven["tension"]
    assert 1e-5 < sideways.max() < 0.01


def test_what_the_thesis_says_is_found(results):
    findings = section_of(EXPERIMENT, results).findings
    assert {finding.claim for finding in findings} == set(EXPERIMENT.claims)
    assert all(finding.verdict is Verdict.AGREES for finding in findings)


def test_other_forces_give_other_verdicts(results):
    rows = []
    for row in results.rows:
        numbers = dict(row.numbers)
        strain = np.array(numbers["strain"])
        numbers["tension"] = (3e6 * strain / (1 + row.point["poisson"])).tolist()
        numbers["shear"] = (2e6 * (strain + strain**2) * (1 + row.point["poisson"])).tolist()
        rows.append(replace(row, numbers=numbers))
    findings = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert all(finding.verdict is Verdict.DIFFERS and finding.why for finding in findings)
