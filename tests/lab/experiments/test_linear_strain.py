"""The linearised strain: values from forces, compared with roots and squares in NumPy."""

import numpy as np
import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Result, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["linear-strain"]


@pytest.fixture(scope="module")
def results():
    return quick_results(EXPERIMENT.name)


@pytest.mark.parametrize(("kind", "entry"), [("stretch", (0, 0)), ("shear", (0, 1))])
def test_strains_are_those_of_the_matrix(results, kind, entry):
    numbers = results.one(kind=kind)
    assert numbers["amount"][-1] == 1.0
    for e, linear, exact in zip(numbers["amount"], numbers["linear"], numbers["exact"], strict=True):
        F = np.eye(3)
        F[entry] += e
        squares, axes = np.linalg.eigh(F @ F.T)
        assert linear == pytest.approx(((F @ F.T - np.eye(3)) / 2)[entry], abs=1e-12)
        assert exact == pytest.approx(((axes * np.sqrt(squares)) @ axes.T - np.eye(3))[entry], abs=1e-12)


def test_the_error_is_told(results):
    (finding,) = section_of(EXPERIMENT, results).findings
    assert finding.verdict is Verdict.AGREES
    assert "5.00% in stretch" in finding.measured  # s / 2
    assert "50%" in finding.measured


def test_a_wrong_linearisation_is_found(results):
    rows = [
        Result(row.point, {**row.numbers, "linear": [1.3 * value for value in row.numbers["linear"]]})
        for row in results.rows
    ]
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    assert finding.verdict is Verdict.DIFFERS
    assert "eq. 6.7" in finding.why
