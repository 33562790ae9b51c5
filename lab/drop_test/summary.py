"""Summarise the outcomes of a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lab.drop_test.case_runs import (
    BRAKE,
    CALM_SPEED,
    CALM_TIME,
    FREE_TIME,
    LEAST_CALM_SPEED,
    PATIENCE,
)
from lab.drop_test.outcome import FAULTS, Outcome

CRITERION = (
    f"at rest: slower than {CALM_SPEED:g} sizes per second or {LEAST_CALM_SPEED * 1000:g} mm/s (root mean "
    f"square over vertices) for {CALM_TIME:g} s, within {PATIENCE:g} T, T = sqrt(size / g) being 0.07 "
    f"to 1 s; after {FREE_TIME:g} T velocities fade at {BRAKE:g} / T, or balls would roll on"
)


@dataclass(frozen=True)
class Summary:
    """Outcomes of all cases of a run."""

    outcomes: tuple[Outcome, ...]

    @property
    def failed(self) -> tuple[Outcome, ...]:
        """Outcomes with at least one failure."""
        return tuple(outcome for outcome in self.outcomes if outcome.faults)

    @property
    def counts(self) -> dict[str, int]:
        """Number of cases with each failure; a case can have several."""
        return {name: sum(name in each.faults for each in self.outcomes) for name in FAULTS}

    def lines(self, worst: int) -> Iterator[str]:
        """Yield the lines to print: totals, the `worst` cases of each failure, a command to repeat a case."""
        total = len(self.outcomes)
        yield f"{total} cases, {total - len(self.failed)} of them sound"
        yield CRITERION
        rests = [each.rest_at for each in self.outcomes if each.rest_at is not None]
        if rests:
            yield f"came to rest after {np.median(rests):.1f} s at the median, {max(rests):.1f} s at the most"
        for name, count in self.counts.items():
            yield f"{name}: {count}"
            faulty = [each for each in self.outcomes if name in each.faults]
            for each in sorted(faulty, key=lambda outcome: -outcome.badness(name))[:worst]:
                yield f"  {each}"
        if self.failed:
            case = self.failed[0].case
            given = "" if case.flips is None else f" --flips {case.flips}"
            yield (
                f"repeat one with: python -m lab drop-test --seed {case.seed} --law {case.law}{given} "
                "--cases 1 --first NUMBER"
            )

    def rows(self) -> dict[str, Any]:
        """Return the summary as data for JSON."""
        return {
            "cases": len(self.outcomes),
            "criterion": CRITERION,
            "counts": self.counts,
            "failed": [
                {"seed": each.case.seed, "case": each.case.number, "faults": each.faults, "text": str(each)}
                for each in self.failed
            ],
        }
