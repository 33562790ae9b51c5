"""Make findings from booleans, and format ranges of numbers.

A finding can judge a claim as a whole, with exceptions, or on several meshes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from lab.experiments.experiment import Finding, Verdict


@dataclass(frozen=True)
class Span:
    """Several numbers that an f-string formats as their range, or as one number."""

    values: Collection[float]

    def __format__(self, how: str) -> str:
        """Format the smallest and the largest number. If both have the same text, return it only once."""
        low, high = format(min(self.values), how), format(max(self.values), how)
        return low if low == high else f"{low} to {high}"


def judged(claim: str, measured: str, agrees: bool, why: str) -> Finding:
    """Make a finding.

    The verdict is "agrees" if `agrees` is True, otherwise "differs" with the reason `why`.
    """
    if agrees:
        return Finding(claim, measured, Verdict.AGREES)
    return Finding(claim, measured, Verdict.DIFFERS, why)


def judged_but_for(
    claim: str, measured: str, agrees: bool, why: str, exceptions: Collection[str], because: str
) -> Finding:
    """Make a finding about a claim that may have exceptions.

    The verdict is "differs" if `agrees` is False, "agrees in part" if there are exceptions, and "agrees"
    otherwise.

    Args:
        exceptions: names for which the claim does not hold, such as laws.
        because: reason for the exceptions, used for the verdict "agrees in part".
    """
    if not agrees or not exceptions:
        return judged(claim, measured, agrees, why)
    return Finding(
        claim, measured, Verdict.PARTLY, f"it does not hold for {', '.join(exceptions)}: {because}"
    )


def judged_on_meshes(claim: str, measured: str, agrees: Collection[bool], why: str) -> Finding:
    """Make a finding from the agreement on each mesh.

    The verdict is "agrees" if all meshes agree and "differs" if none agrees. Otherwise it is "cannot be
    told", because the thesis does not publish its meshes.
    """
    if all(agrees) or not any(agrees):
        return judged(claim, measured, all(agrees), why)
    on = f"it holds on {sum(agrees)} of {len(agrees)} meshes, and the thesis's is not known: {why}"
    return Finding(claim, measured, Verdict.UNKNOWN, on)
