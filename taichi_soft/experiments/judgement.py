"""A finding from a yes or no, or from one on each of several meshes."""

from __future__ import annotations

from collections.abc import Collection

from taichi_soft.experiments.experiment import Finding, Verdict


def judged(claim: str, measured: str, agrees: bool, why: str) -> Finding:
    """Agrees, or differs for the reason given."""
    if agrees:
        return Finding(claim, measured, Verdict.AGREES)
    return Finding(claim, measured, Verdict.DIFFERS, why)


def judged_on_meshes(claim: str, measured: str, agrees: Collection[bool], why: str) -> Finding:
    """Agrees on every mesh, differs on every mesh, or depends on the mesh, which the thesis leaves open."""
    if all(agrees) or not any(agrees):
        return judged(claim, measured, all(agrees), why)
    on = f"it holds on {sum(agrees)} of {len(agrees)} meshes, and the thesis's is not known: {why}"
    return Finding(claim, measured, Verdict.UNKNOWN, on)
