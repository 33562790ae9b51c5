"""Bodies that run backwards."""

import pytest
from quick import quick_results

from lab.experiments import EXPERIMENTS, Effort, Result, Results, Verdict, section_of

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


def test_leapfrog_comes_back_and_the_euler_methods_do_not():
    experiment = EXPERIMENTS["leapfrog-reversal"]
    rows = list(quick_results(experiment.name).rows)
    ways = {row.point["integrator"]: row.numbers["left"] / row.numbers["out"] for row in rows}
    assert ways["leapfrog"] < 1e-5
    assert min(ways["explicit_euler"], ways["lazy_leapfrog"]) > 0.01
    (finding,) = section_of(experiment, Results(tuple(rows))).findings
    assert finding.claim == "leapfrog-reversible"
    assert finding.verdict is Verdict.AGREES


def test_of_what_is_missing_nothing_can_be_told():
    experiment = EXPERIMENTS["leapfrog-reversal"]
    rows = [Result(point, None, "lost") for point in experiment.points(Effort.QUICK)]
    (finding,) = section_of(experiment, Results(tuple(rows))).findings
    assert finding.verdict is Verdict.UNKNOWN
    assert "3 of 3 points failed" in finding.why
