"""Experiments: points to measure one by one, and a conclusion from all of them.

A point is plain data, and so are its numbers. Points can therefore be computed in other processes, and stored
in a file. The pages, plots and tables are made afterwards from these numbers.
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
"""Names and values of the varied quantities: numbers, strings, booleans."""

Numbers = dict[str, Any]
"""Measured numbers, strings, booleans and lists of these, in SI units."""


class MissingPointError(TaichiSoftError):
    """A conclusion needs a point that failed."""


class Effort(Choice):
    """Extent of a report: a coarse answer to every claim within minutes, or everything."""

    QUICK = "quick"
    FULL = "full"


class Verdict(Choice):
    """Result of a measurement for a claim."""

    AGREES = "agrees"
    PARTLY = "agrees in part"
    DIFFERS = "differs"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True)
class Finding:
    """Measurement and verdict for one claim.

    Args:
        claim: its key in `CLAIMS`.
        measured: a sentence with the figures and their units, and the tolerance of the verdict.
        verdict: whether the figures agree with the claim.
        why: reason if they do not, or only in part: model, mesh or reading of the text, and the evidence.
    """

    claim: str
    measured: str
    verdict: Verdict
    why: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of numbers and words.

    Args:
        name: name of its file, unique within the experiment.
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
        name: name of its file, unique within the experiment.
        caption: one or two sentences: what is drawn, and what it shows.
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
    """Conclusion of an experiment.

    Args:
        text: paragraphs for a reader who knows the thesis: the set-up, and the result.
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
        """Measured points with these values, in order, and their numbers."""
        return [
            (row.point, row.numbers)
            for row in self.rows
            if row.numbers is not None and all(row.point.get(key) == value for key, value in values.items())
        ]

    def one(self, **values: Any) -> Numbers:
        """Numbers of the only point with these values.

        Raises: MissingPointError if there is none, or more than one.
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
        source: section or figure of the thesis, or the theory beyond it.
        claims: keys in `CLAIMS`; its section has one finding for each.
        points: points of a quick or a full report.
        measure: function of a module that measures one point, in any process. The device was chosen before.
        conclude: function of the measured points. Raises: MissingPointError if a needed point is missing.
        is_timing: True if its points measure time: they run alone, one after the other.
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
    """Conclusion from the results. If points are missing, its claims cannot be told."""
    try:
        return experiment.conclude(results)
    except MissingPointError as error:
        why = f"{len(results.failed)} of {len(results.rows)} points failed: {error}"
        findings = [Finding(claim, "not measured", Verdict.UNKNOWN, why) for claim in experiment.claims]
        return Section((), tuple(findings))
