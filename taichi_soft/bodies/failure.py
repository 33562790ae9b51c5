"""What made a body go non-finite, as its owner is told."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Failure:
    """Why a body was frozen."""

    body: int  # its slot
    tetrahedron: int | None  # that broke first, in the caller's order; None if it cannot be told
    step: int  # of the world, counted from 0, which was undone for this body
    substep: int | None  # within that step, or the finest attempt at it
    time: float  # [s], of the last sound state, in which the body now rests
    edge: tuple[int, int] | None = None  # instead of a tetrahedron where forces act along edges


@dataclass(frozen=True)
class FailedStep:
    """The fixed step in which a body went non-finite."""

    step: int
    time: float  # [s], before it
    substeps: int  # of the last attempt at it
    h: float  # [s]
    is_braked: bool  # whether vibrations were braked in it
