"""Volume under CMPM: a closed form on a cubic lattice, and verdicts that depend on the numbers."""

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Effort, Result, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

EXPERIMENT = EXPERIMENTS["shear-modulus-volume"]


def verdict(rows):
    (finding,) = section_of(EXPERIMENT, Results(tuple(rows))).findings
    return finding.verdict, finding.why


@pytest.mark.parametrize("modulus", [0.1, 1.0])
def test_a_cubic_lattice_does_not_narrow(modulus):
    """Only edges of the grid have a Voronoi face there: bonds along three axes know no Poisson's ratio."""
    numbers = EXPERIMENT.measure({"way": "stretched", "seed": None, "modulus": modulus})
    assert numbers["volume"] == pytest.approx([1.1, 1.2], abs=1e-3)


def test_it_holds_in_shear_and_not_in_tension():
    rows = list(quick_results(EXPERIMENT.name).rows)
    results = Results(tuple(rows))
    soft, stiff = (results.one(way="stretched", modulus=g)["volume"][-1] for g in (0.1, 0.5))
    assert 1 < soft < stiff  # narrowing less
    decided, why = verdict(rows)
    assert decided is Verdict.UNKNOWN
    assert "sheared on 1 of 1" in why
    assert "stretched on 0 of 1" in why


def test_volumes_decide():
    points = EXPERIMENT.points(Effort.FULL)
    keeps = [Result(p, {"amount": [0.2], "volume": [1.2 - 0.1 * p["modulus"]]}) for p in points]
    assert verdict(keeps) == (Verdict.AGREES, "")
    loses = [Result(p, {"amount": [0.2], "volume": [1.2 + 0.1 * p["modulus"]]}) for p in points]
    assert verdict(loses)[0] is Verdict.DIFFERS
