"""Write numbers as CSV with all digits."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from typing import Any

from lab.experiments import Results, Table
from lab.report.judgements import Judgement
from lab.report.wording import plain


def csv_of_table(table: Table) -> str:
    """Convert a table to CSV."""
    return _written([table.columns, *table.rows])


def csv_of_points(results: Results) -> str:
    """Return a CSV row for each point: varied and measured values, error, and computing time.

    Lists are written as JSON.
    """
    varied = list(dict.fromkeys(name for row in results.rows for name in row.point))
    measured = list(dict.fromkeys(name for row in results.rows for name in row.numbers or {}))
    rows: list[Sequence[Any]] = [
        [
            *(f"point.{name}" for name in varied),
            *(f"measured.{name}" for name in measured),
            "error",
            "seconds",
        ]
    ]
    for row in results.rows:
        numbers = row.numbers or {}
        found = [*(row.point.get(name) for name in varied), *(numbers.get(name) for name in measured)]
        rows.append([*found, row.error, row.seconds])
    return _written(rows)


def csv_of_judgements(judgements: Iterable[Judgement]) -> str:
    """Return a CSV row for each finding, and one for each claim without a finding."""
    rows: list[Sequence[Any]] = [
        ("claim", "chapter", "source", "text", "verdict", "measured", "why", "experiment")
    ]
    for each in judgements:
        about = (each.key, each.chapter, each.claim.source, each.claim.text)
        for experiment, finding in each.findings:
            rows.append((*about, finding.verdict.value, finding.measured, finding.why, experiment.name))
        if not each.findings:
            rows.append((*about, each.outcome, "", "", ""))
    return _written(rows)


def _written(rows: Iterable[Sequence[Any]]) -> str:
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerows([_cell(value) for value in row] for row in rows)
    return file.getvalue()


def _cell(value: Any) -> Any:
    """Format a value: numbers exactly, as Python writes them; lists and booleans as JSON."""
    value = plain(value)
    return json.dumps(value, default=plain) if isinstance(value, (list, tuple, dict, bool)) else value
