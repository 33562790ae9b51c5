"""All claims, each with what was found about it, in one list."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from lab.experiments import CLAIMS, Claim, Experiment, Finding, Results, Section, Verdict
from taichi_soft.core.errors import OptionError

Concluded = tuple[Experiment, Results, Section]
"""An experiment, its points and what follows from them."""

NOT_MEASURED = "not measured"
OUTCOMES = (*(verdict.value for verdict in Verdict), NOT_MEASURED)
"""What can be said of a claim, in words."""

OF_MANY = {name: name for name in OUTCOMES} | {
    "agrees": "agree",
    "agrees in part": "agree in part",
    "differs": "differ",
}
"""The same of several claims."""

CHAPTERS = {
    "3": "Chapter 3, Computational physics",
    "4": "Chapter 4, CMPM",
    "5": "Chapter 5, Shear by volume preservation",
    "6": "Chapter 6, Three-dimensional springs",
}
THEORY = "Beyond the thesis: theory"


@dataclass(frozen=True)
class Judgement:
    """A claim and all findings about it, each with the experiment that it comes from."""

    key: str
    claim: Claim
    findings: tuple[tuple[Experiment, Finding], ...]

    @property
    def outcome(self) -> str:
        """One of `OUTCOMES`; of several findings the least favourable one decides."""
        verdicts = [finding.verdict for _, finding in self.findings]
        for verdict in (Verdict.DIFFERS, Verdict.UNKNOWN, Verdict.PARTLY, Verdict.AGREES):
            if verdict in verdicts:
                return str(verdict.value)
        return NOT_MEASURED

    @property
    def chapter(self) -> str:
        """Of the thesis, by the number of its section or figure."""
        number = re.match(r"(?:chapter|section|figure) (\d)", self.claim.source)
        return CHAPTERS.get(number.group(1), THEORY) if number else THEORY


def judge(sections: Sequence[Concluded]) -> list[Judgement]:
    """Every claim there is, in order. Raises: OptionError for a finding about no claim."""
    found: dict[str, list[tuple[Experiment, Finding]]] = {key: [] for key in CLAIMS}
    for experiment, _, section in sections:
        for finding in section.findings:
            if finding.claim not in found:
                raise OptionError(
                    f"{experiment.name} has a finding about {finding.claim!r}, which is no claim"
                )
            found[finding.claim].append((experiment, finding))
    return [Judgement(key, claim, tuple(found[key])) for key, claim in CLAIMS.items()]


def counts(judgements: Sequence[Judgement]) -> dict[str, int]:
    """How many claims have each outcome, in the order of `OUTCOMES`."""
    return {name: sum(each.outcome == name for each in judgements) for name in OUTCOMES}
