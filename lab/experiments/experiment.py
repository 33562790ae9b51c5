"""What an experiment is: points to measure, one by one, and what follows from all of them.

A point is plain data, and so is what is measured there: points can be computed in other processes, kept in a
file and taken up again. All that people look at is made afterwards, in one place, from these numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_soft.core.errors import TaichiSoftError
from taichi_soft.core.types import Choice

Point = dict[str, Any]
"""Names and values of what is varied: numbers, strings, booleans."""

Numbers = dict[str, Any]
"""What was measured: numbers, strings, booleans and lists of these, in SI units."""


class MissingPointError(TaichiSoftError):
    """A conclusion asks for a point that failed."""


class Effort(Choice):
    """How much to compute: a coarse answer to every claim within minutes, or all of it."""

    QUICK = "quick"
    FULL = "full"


class Verdict(Choice):
    """What a measurement says about a claim."""

    AGREES = "agrees"
    PARTLY = "agrees in part"
    DIFFERS = "differs"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True)
class Finding:
    """What was measured about one claim.

    Args:
        claim: its key in `CLAIMS`.
        measured: a sentence with the figures and their units.
        verdict: whether they agree with the claim.
        why: where they do not agree, or not for all laws: whether model, mesh or reading of the text is the
            likely cause, and the evidence.
    """

    claim: str
    measured: str
    verdict: Verdict
    why: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of numbers and words.

    Args:
        name: of its file, unique within the experiment.
        columns: headings, with the unit in brackets: "force [N]".
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class Plot:
    """A plot.

    Args:
        name: of its file, unique within the experiment.
        caption: a sentence or two: what is drawn, and what to see in it.
        draw: draws into an empty figure of matplotlib, with units on every axis.
        size: width and height [inches].
    """

    name: str
    caption: str
    draw: Callable[[Any], None]
    size: tuple[float, float] = (6.4, 4.0)


@dataclass(frozen=True)
class Picture:
    """A picture of bodies, (height, width, 3) uint8, red first."""

    name: str
    caption: str
    image: NDArray[np.uint8]


@dataclass(frozen=True)
class Section:
    """What follows from an experiment.

    Args:
        text: paragraphs for a reader who knows the thesis: what was done, and what was learned.
    """

    text: tuple[str, ...]
    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Result:
    """A point that was measured, or failed."""

    point: Point
    numbers: Numbers | None
    error: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class Results:
    """All points of an experiment."""

    rows: tuple[Result, ...] = field(default=())

    def where(self, **values: Any) -> list[tuple[Point, Numbers]]:
        """Points with these values that were measured, in order, and their numbers."""
        return [
            (row.point, row.numbers)
            for row in self.rows
            if row.numbers is not None and all(row.point.get(key) == value for key, value in values.items())
        ]

    def one(self, **values: Any) -> Numbers:
        """Numbers of the only point with these values.

        Raises: MissingPointError where there is none, or more than one.
        """
        found = self.where(**values)
        if len(found) != 1:
            raise MissingPointError(f"{len(found)} points with {values}, wanted 1")
        return found[0][1]

    @property
    def failed(self) -> list[Result]:
        """Points that failed."""
        return [row for row in self.rows if row.numbers is None]


@dataclass(frozen=True)
class Experiment:
    """An experiment.

    Args:
        name: short and unique, as in `python -m lab report NAME`.
        source: where the thesis has it, or what it is beyond the thesis.
        claims: keys in `CLAIMS` that its section has a finding for, each.
        points: what to measure for a quick or a full report.
        measure: measures one point, in any process: a function of a module. The device was chosen before.
        conclude: from the points that were measured; MissingPointError where one that it needs is missing.
        is_timing: its points measure time: they run alone, one after the other.
    """

    name: str
    title: str
    source: str
    claims: tuple[str, ...]
    points: Callable[[Effort], list[Point]]
    measure: Callable[[Point], Numbers]
    conclude: Callable[[Results], Section]
    is_timing: bool = False


def section_of(experiment: Experiment, results: Results) -> Section:
    """What follows from the results; of what is missing, nothing can be told."""
    try:
        return experiment.conclude(results)
    except MissingPointError as error:
        why = f"{len(results.failed)} of {len(results.rows)} points failed: {error}"
        findings = [Finding(claim, "not measured", Verdict.UNKNOWN, why) for claim in experiment.claims]
        return Section((), tuple(findings))
