"""A finding from a yes or no, or from one on each of several meshes; and how several numbers are told."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from lab.experiments.experiment import Finding, Verdict


@dataclass(frozen=True)
class Span:
    """Several numbers, which an f-string tells as one, or as the least and the largest."""

    values: Collection[float]

    def __format__(self, how: str) -> str:
        """As each number alone; one where they look alike."""
        low, high = format(min(self.values), how), format(max(self.values), how)
        return low if low == high else f"{low} to {high}"


def judged(claim: str, measured: str, agrees: bool, why: str) -> Finding:
    """Agrees, or differs for the reason given."""
    if agrees:
        return Finding(claim, measured, Verdict.AGREES)
    return Finding(claim, measured, Verdict.DIFFERS, why)


def judged_but_for(
    claim: str, measured: str, agrees: bool, why: str, exceptions: Collection[str], because: str
) -> Finding:
    """Agrees, agrees but for `exceptions`, such as some of the laws, or differs for the reason `why`."""
    if not agrees or not exceptions:
        return judged(claim, measured, agrees, why)
    return Finding(
        claim, measured, Verdict.PARTLY, f"it does not hold for {', '.join(exceptions)}: {because}"
    )


def judged_on_meshes(claim: str, measured: str, agrees: Collection[bool], why: str) -> Finding:
    """Agrees on every mesh, differs on every mesh, or depends on the mesh, which the thesis leaves open."""
    if all(agrees) or not any(agrees):
        return judged(claim, measured, all(agrees), why)
    on = f"it holds on {sum(agrees)} of {len(agrees)} meshes, and the thesis's is not known: {why}"
    return Finding(claim, measured, Verdict.UNKNOWN, on)
