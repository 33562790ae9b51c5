"""Judge a run: a verdict and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from taichi_soft.core.types import Choice

MOST_SUBSTEPS = 500
"""Largest number of substeps per 1/60 s. A body that needs more is too slow for a game."""

SHAPE_TOLERANCE = 0.01
"""Largest distance of a valid body from its rest shape at the end [sizes of the body]."""

SPEED_TOLERANCE = 1.5
"""Largest speed of a valid body at the end, divided by the largest speed during the fall. A faster body has
gained energy."""


class Verdict(Choice):
    """Verdicts, worst first.

    `TOO_SOFT` means that tetrahedra are inverted after `World.build` warned that the body is too soft.
    `NO_RESULT` means that the run failed.
    """

    FROZEN = "frozen"
    INVERTED = "inverted"
    RUNAWAY = "runaway"
    MISSHAPEN = "misshapen"
    TOO_SOFT = "too soft"
    TOO_SLOW = "too slow"
    REFUSED = "refused"
    NO_RESULT = "no result"
    OK = "ok"


@dataclass(frozen=True)
class Ending:
    """Measurements at the end of a run."""

    tets: int
    failure: str | None  # reason why the body froze; None if it is not frozen
    is_finite: bool
    flipped: int  # number of inverted tetrahedra
    speed: float  # root mean square speed, weighted by mass [m/s]
    fastest: float  # largest speed during the fall [m/s]; infinite if the body started strongly deformed
    distance: float = 0.0  # distance from the rest shape after a strongly deformed start [body sizes]


def judge(end: Ending) -> tuple[Verdict, str]:
    """Return the worst verdict that applies, and its reason. The reason for `OK` is empty."""
    if end.failure is not None:
        return Verdict.FROZEN, end.failure
    if not end.is_finite:
        return Verdict.FROZEN, "positions are not finite, and it does not say that it is frozen"
    if end.flipped:
        return Verdict.INVERTED, f"{end.flipped} of {end.tets} tetrahedra inside out at the end"
    if end.speed > SPEED_TOLERANCE * end.fastest:
        return Verdict.RUNAWAY, f"{end.speed:.3g} m/s at the end, a fall gives {end.fastest:.3g}"
    if end.distance > SHAPE_TOLERANCE:
        return Verdict.MISSHAPEN, f"{100 * end.distance:.3g} % of its size from its rest shape"
    return Verdict.OK, ""
