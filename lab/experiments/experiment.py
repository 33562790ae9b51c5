"""Experiments: points that are measured one by one, and a conclusion from all points.

A point and its measured numbers are plain data, so points can be measured in other processes and stored in a
file. Pages, plots and tables are made from these numbers afterwards.
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
"""Values of the varied quantities, by name: numbers, strings, booleans."""

Numbers = dict[str, Any]
"""Measured numbers, strings, booleans and lists of these, by name, in SI units."""


class MissingPointError(TaichiSoftError):
    """A point that a conclusion needs has failed."""


class Effort(Choice):
    """Extent of a report: a coarse answer to every claim within minutes (`QUICK`), or all points (`FULL`)."""

    QUICK = "quick"
    FULL = "full"


class Verdict(Choice):
    """Agreement of a measurement with a claim."""

    AGREES = "agrees"
    PARTLY = "agrees in part"
    DIFFERS = "differs"
    UNKNOWN = "cannot be told"


@dataclass(frozen=True)
class Finding:
    """A measurement and its verdict on one claim.

    Args:
        claim: key of the claim in `CLAIMS`.
        measured: a sentence with the figures, their units, and the tolerance of the verdict.
        verdict: agreement of the figures with the claim.
        why: reason if the figures do not fully agree (model, mesh or reading of the text), with evidence.
    """

    claim: str
    measured: str
    verdict: Verdict
    why: str = ""


@dataclass(frozen=True)
class Table:
    """A table of numbers and words.

    Args:
        name: file name, unique within the experiment.
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
        name: file name, unique within the experiment.
        caption: one or two sentences about the contents of the plot.
        draw: function that draws into an empty figure of matplotlib, with units on every axis.
        size: width and height [inches].
    """

    name: str
    caption: str
    draw: Callable[[Any], None]
    size: tuple[float, float] = (6.4, 4.0)


@dataclass(frozen=True)
class Picture:
    """An image of bodies, RGB, uint8 (height, width, 3)."""

    name: str
    caption: str
    image: NDArray[np.uint8]


@dataclass(frozen=True)
class Section:
    """Conclusion of an experiment.

    Args:
        text: paragraphs about the set-up and the result, for a reader who knows the thesis.
    """

    text: tuple[str, ...]
    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()
    plots: tuple[Plot, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Result:
    """The numbers of a measured point, or its error."""

    point: Point
    numbers: Numbers | None
    error: str = ""
    seconds: float = 0.0


@dataclass(frozen=True)
class Results:
    """Results of all points of an experiment."""

    rows: tuple[Result, ...] = field(default=())

    def where(self, **values: Any) -> list[tuple[Point, Numbers]]:
        """Return the measured points that have these values, each with its numbers, in order."""
        return [
            (row.point, row.numbers)
            for row in self.rows
            if row.numbers is not None and all(row.point.get(key) == value for key, value in values.items())
        ]

    def one(self, **values: Any) -> Numbers:
        """Return the numbers of the only measured point with these values.

        Raises: MissingPointError if no point or more than one point has these values.
        """
        found = self.where(**values)
        if len(found) != 1:
            raise MissingPointError(f"{len(found)} points with {values}, wanted 1")
        return found[0][1]

    @property
    def failed(self) -> list[Result]:
        """Results of the points that failed."""
        return [row for row in self.rows if row.numbers is None]


@dataclass(frozen=True)
class Experiment:
    """An experiment.

    Args:
        name: short unique name, as in `python -m lab report NAME`.
        source: section or figure of the thesis, or the theory behind an experiment that is not in the thesis.
        claims: keys in `CLAIMS`. The section contains one finding for each claim.
        points: function that lists the points of a quick or a full report.
        measure: module-level function that measures one point, in any process. The device is already chosen.
        conclude: function that judges the results. Raises: MissingPointError if a needed point is missing.
        is_timing: True if the points measure time. Points that measure time run alone, one after the other.
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
    """Return the conclusion of an experiment. If points are missing, its verdicts are "cannot be told"."""
    try:
        return experiment.conclude(results)
    except MissingPointError as error:
        why = f"{len(results.failed)} of {len(results.rows)} points failed: {error}"
        findings = [Finding(claim, "not measured", Verdict.UNKNOWN, why) for claim in experiment.claims]
        return Section((), tuple(findings))
