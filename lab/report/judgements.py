"""Collect all claims with their findings, and count how many agree."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from lab.experiments import CLAIMS, Claim, Experiment, Finding, Results, Section, Verdict
from taichi_soft.core.errors import OptionError

Concluded = tuple[Experiment, Results, Section]
"""An experiment, its results, and its section of the report."""

NOT_MEASURED = "not measured"
OUTCOMES = (*(verdict.value for verdict in Verdict), NOT_MEASURED)
"""All outcomes of a claim, in words."""

PLURAL = {"agrees": "agree", "agrees in part": "agree in part", "differs": "differ"}
"""Plural form of each outcome whose plural differs from the singular."""

KINDS = {True: "claims of the thesis", False: "statements of theory"}
"""Names of both kinds of claims, by `Claim.is_of_thesis`."""

CHAPTERS = {
    "3": "Chapter 3, Computational physics",
    "4": "Chapter 4, CMPM",
    "5": "Chapter 5, Shear by volume preservation",
    "6": "Chapter 6, Three-dimensional springs",
    "7": "Chapter 7, Conclusion",
}
THEORY = "Beyond the thesis: theory"


@dataclass(frozen=True)
class Judgement:
    """A claim and all findings on it, each with its experiment."""

    key: str
    claim: Claim
    findings: tuple[tuple[Experiment, Finding], ...]

    @property
    def outcome(self) -> str:
        """Least favourable outcome of the findings, one of `OUTCOMES`."""
        verdicts = [finding.verdict for _, finding in self.findings]
        for verdict in (Verdict.DIFFERS, Verdict.UNKNOWN, Verdict.PARTLY, Verdict.AGREES):
            if verdict in verdicts:
                return str(verdict.value)
        return NOT_MEASURED

    @property
    def chapter(self) -> str:
        """Heading of the claim's chapter of the thesis, or the heading of theory."""
        number = re.match(r"(?:chapter|section|figure) (\d)", self.claim.source)
        return CHAPTERS.get(number.group(1), THEORY) if number else THEORY


def judge(sections: Sequence[Concluded]) -> list[Judgement]:
    """Return all claims with their findings, in order.

    Raises: OptionError for a finding on an unknown claim.
    """
    found: dict[str, list[tuple[Experiment, Finding]]] = {key: [] for key in CLAIMS}
    for experiment, _, section in sections:
        for finding in section.findings:
            if finding.claim not in found:
                raise OptionError(
                    f"{experiment.name} has a finding about {finding.claim!r}, which is no claim"
                )
            found[finding.claim].append((experiment, finding))
    return [Judgement(key, claim, tuple(found[key])) for key, claim in CLAIMS.items()]


def counts(judgements: Sequence[Judgement]) -> dict[str, dict[str, int]]:
    """Count the claims of each kind in `KINDS` by outcome, in the order of `OUTCOMES`."""
    found = {}
    for is_of_thesis, kind in KINDS.items():
        outcomes = [each.outcome for each in judgements if each.claim.is_of_thesis is is_of_thesis]
        found[kind] = {name: outcomes.count(name) for name in OUTCOMES}
    return found


def in_words(outcome: str, number: int) -> str:
    """Format the outcome of a number of claims: "1 agrees", "2 agree"."""
    return f"{number} {outcome if number == 1 else PLURAL.get(outcome, outcome)}"
