"""Failures of bodies: records of when and where a body became non-finite."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Time and place at which a body became non-finite and was frozen."""

    body: int  # slot of the body
    tetrahedron: int | None  # first tetrahedron that failed, in the caller's order; None if unknown
    step: int  # index of the step that was undone for this body, from 0
    substep: int | None  # substep in which the last attempt at that step failed; None if unknown
    time: float  # [s], time of the last valid state; the frozen body stays in this state
    edge: tuple[int, int] | None = None  # first edge that failed, for a rod or a law along edges
    triangle: int | None = None  # first triangle that failed, for a shell


@dataclass(frozen=True)
class FailedStep:
    """Data of the fixed step in which a body became non-finite."""

    step: int
    time: float  # [s], time before the step
    substeps: int  # number of substeps in the last attempt
    h: float  # [s], length of a substep
    is_braked: bool  # True if the last attempt damped vibrations strongly
