"""Small angles, high Poisson's ratios and the largest stable step."""

import copy

import numpy as np
import pytest
from linear_motion import quadratic_form
from quick import quick_results

from lab.experiments import EXPERIMENTS, Results, Verdict, section_of
from lab.experiments.mesh_quality import cubes, spoilt_cube

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["mesh-quality"]


@pytest.fixture(scope="module")
def rows():
    return list(quick_results(EXPERIMENT.name).rows)


def verdict_of(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding.verdict


def test_runs_break_where_the_fastest_vibration_says(rows):
    """Leapfrog is stable up to 2 / omega, omega from the dense eigenvalue problem of linear elasticity."""
    for row in rows:
        for i, (_, _, mesh) in enumerate(cubes()):
            form = quadratic_form(mesh, 1e6, row.point["poisson"], 1000.0, 0.0, 1.0)
            limit = 2 / np.sqrt(np.linalg.eigvalsh(form)[-1])
            assert row.numbers["held"][i] < 1.01 * limit
            assert row.numbers["broke"][i] > 0.99 * limit
            assert row.numbers["broke"][i] < 1.1 * row.numbers["held"][i]


def test_the_smallest_angle_of_a_flattened_tetrahedron_is_its_height_s():
    """Between the base and a side of a regular tetrahedron tan is 2 sqrt(2), and falls with the height."""
    angle = spoilt_cube("tetrahedron", 0.01).quality.min_dihedral.min()
    assert np.tan(np.radians(angle)) == pytest.approx(0.01 * 2 * np.sqrt(2), rel=1e-3)
    assert spoilt_cube("layer", 0.1).volumes.sum() == pytest.approx(1.0)


def test_the_verdict_follows_the_numbers(rows):
    assert verdict_of(rows) is Verdict.AGREES
    for key in ("angle", "ratio"):
        other = copy.deepcopy(rows)
        for row in other:
            held = row.numbers["held"]
            if key == "angle":
                row.numbers["held"] = [held[0]] * len(held)
            else:
                row.numbers["held"] = rows[0].numbers["held"]
        assert verdict_of(other) is Verdict.DIFFERS
