"""Failures of bodies that became non-finite."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Cause of the freezing of a body."""

    body: int  # its slot
    tetrahedron: int | None  # the first that failed, in the caller's order; None if unknown
    step: int  # step of the world, counted from 0, that was undone for this body
    substep: int | None  # within that step, or its finest retry
    time: float  # [s], of the last valid state, in which the body now rests
    edge: tuple[int, int] | None = None  # instead of a tetrahedron, for forces along edges


@dataclass(frozen=True)
class FailedStep:
    """The fixed step in which a body became non-finite."""

    step: int
    time: float  # [s], before the step
    substeps: int  # of the last retry
    h: float  # [s]
    is_braked: bool  # True if vibrations were braked in it
