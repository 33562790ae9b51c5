"""All claims with their findings, and how many of them agree."""

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
"""Outcomes of a claim, in words."""

PLURAL = {"agrees": "agree", "agrees in part": "agree in part", "differs": "differ"}
"""Outcomes of several claims, if the words differ from those of one."""

KINDS = {True: "claims of the thesis", False: "statements of theory"}
"""Names of the two kinds of claims, by `Claim.is_of_thesis`."""

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
    """A claim and all findings about it, each with its experiment."""

    key: str
    claim: Claim
    findings: tuple[tuple[Experiment, Finding], ...]

    @property
    def outcome(self) -> str:
        """One of `OUTCOMES`. The least favourable of several findings decides."""
        verdicts = [finding.verdict for _, finding in self.findings]
        for verdict in (Verdict.DIFFERS, Verdict.UNKNOWN, Verdict.PARTLY, Verdict.AGREES):
            if verdict in verdicts:
                return str(verdict.value)
        return NOT_MEASURED

    @property
    def chapter(self) -> str:
        """Heading of its chapter of the thesis, or that of theory."""
        number = re.match(r"(?:chapter|section|figure) (\d)", self.claim.source)
        return CHAPTERS.get(number.group(1), THEORY) if number else THEORY


def judge(sections: Sequence[Concluded]) -> list[Judgement]:
    """All claims in their order, with their findings. Raises: OptionError for a finding about no claim."""
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
    """Number of claims with each outcome, in the order of `OUTCOMES`, by the names in `KINDS`."""
    found = {}
    for is_of_thesis, kind in KINDS.items():
        outcomes = [each.outcome for each in judgements if each.claim.is_of_thesis is is_of_thesis]
        found[kind] = {name: outcomes.count(name) for name in OUTCOMES}
    return found


def in_words(outcome: str, number: int) -> str:
    """The outcome of a number of claims: "1 agrees", "2 agree"."""
    return f"{number} {outcome if number == 1 else PLURAL.get(outcome, outcome)}"
