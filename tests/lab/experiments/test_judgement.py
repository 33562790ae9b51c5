"""Verdicts from booleans, for a claim as a whole and with exceptions."""

import pytest

from lab.experiments import EXPERIMENTS, Finding, Results, Section, Verdict
from lab.experiments.judgement import judged_but_for
from lab.report.judgements import judge

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


@pytest.mark.parametrize(
    ("agrees", "exceptions", "verdict", "why"),
    [
        (True, [], Verdict.AGREES, ""),
        (True, ["springs", "cmpm"], Verdict.PARTLY, "it does not hold for springs, cmpm: no stress"),
        (False, [], Verdict.DIFFERS, "the mesh"),
        (False, ["springs"], Verdict.DIFFERS, "the mesh"),
    ],
)
def test_a_claim_with_exceptions_agrees_in_part_and_names_them(agrees, exceptions, verdict, why):
    finding = judged_but_for("hertz", "7 N", agrees, "the mesh", exceptions, "no stress")
    assert finding == Finding("hertz", "7 N", verdict, why)


@pytest.mark.parametrize(
    ("verdicts", "outcome"),
    [
        ((Verdict.AGREES, Verdict.PARTLY), "agrees in part"),
        ((Verdict.PARTLY, Verdict.UNKNOWN), "cannot be told"),
        ((Verdict.DIFFERS, Verdict.PARTLY), "differs"),
    ],
)
def test_of_several_findings_the_least_favourable_one_decides(verdicts, outcome):
    section = Section((), tuple(Finding("hertz", "", verdict) for verdict in verdicts))
    (found,) = [each for each in judge([(EXPERIMENTS["hertz"], Results(), section)]) if each.findings]
    assert found.outcome == outcome
