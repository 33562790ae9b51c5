"""Outcomes of dropped spheres of many moduli, and the range of moduli for which they stay intact."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lab.experiments.experiment import Numbers

OUTCOMES = ("collapses", "dented", "whole", "explodes")

COLLAPSED = 0.5
"""Largest volume of a collapsed sphere, as a fraction of its rest volume. The thesis gives no number."""

Window = tuple[float, float, float, float]
"""Four moduli (low, first, last, high) that `window` returns [Pa]."""


def outcomes(numbers: Numbers, collapsed: float = COLLAPSED) -> list[str]:
    """Return the outcome of each sphere: "explodes", "collapses", "dented" or "whole".

    A sphere explodes if it becomes non-finite or doubles in extent. If more than a hundredth of its
    tetrahedra stay inverted, it collapses if its volume is at most `collapsed` times that at rest; otherwise
    it is dented.
    """
    ends = []
    for volume, flipped, frozen, extent in zip(
        numbers["volume"], numbers["flipped"], numbers["frozen"], numbers["extent"], strict=True
    ):
        if frozen or extent > 2.0:
            ends.append("explodes")
        elif flipped > 0.01:
            ends.append("collapses" if volume <= collapsed else "dented")
        else:
            ends.append("whole")
    return ends


def window(numbers: Numbers, collapsed: float = COLLAPSED) -> Window:
    """Return the longest range of moduli with whole spheres as (low, first, last, high) [Pa].

    `first` and `last` are the ends of the range. `low` is the last modulus below the range whose sphere is
    neither whole nor dented, or 0. `high` is the first modulus above the range whose sphere explodes, or
    infinity. If no sphere is whole, the result is (inf, inf, 0, 0).
    """
    young, ends = numbers["young"], outcomes(numbers, collapsed)
    first, last = _longest_row(end == "whole" for end in ends)
    if first > last:
        return np.inf, np.inf, 0.0, 0.0
    gone = [i for i in range(first) if ends[i] not in ("dented", "whole")]
    exploded = [i for i in range(last, len(ends)) if ends[i] == "explodes"]
    low = young[gone[-1]] if gone else 0.0
    high = young[exploded[0]] if exploded else np.inf
    return low, young[first], young[last], high


def _longest_row(values: Iterable[bool]) -> tuple[int, int]:
    """Return the first and last index of the longest run of true values; last < first if there is none."""
    best, start, at = (0, -1), 0, -1
    for at, value in enumerate(values):
        if not value:
            start = at + 1
        elif at - start > best[1] - best[0]:
            best = start, at
    return best
