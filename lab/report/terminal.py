"""Print sections and verdicts in the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from lab.experiments import CLAIMS, Experiment, Results, Section, Table
from lab.report.judgements import NOT_MEASURED, Judgement, counts, in_words
from lab.report.wording import duration, numeric_columns, point_line, readable

COLOURS = {
    "agrees": "green",
    "agrees in part": "yellow",
    "differs": "dark_orange",
    "cannot be told": "magenta",
    "not measured": "dim",
}
MOST_ROWS = 20
"""Largest number of printed rows of a table; the report has all rows."""

BETWEEN, WIDEST = 3, 40
"""Number of characters between columns, and largest number of characters of a cell that is not wrapped."""


def print_section(console: Console, experiment: Experiment, results: Results, section: Section) -> None:
    """Print a section without its images."""
    failed = results.failed
    console.print()
    console.print(Text(experiment.title, style="bold"))
    facts = [experiment.source, f"{len(results.rows)} point{'s' * (len(results.rows) != 1)}"]
    facts += [f"{len(failed)} failed"] if failed else []
    facts.append(f"{duration(sum(row.seconds for row in results.rows))} of computing")
    console.print(Text(", ".join(facts), style="dim"))
    for paragraph in section.text:
        console.print()
        console.print(Text(paragraph))
    for finding in section.findings:
        console.print()
        claim = CLAIMS[finding.claim]
        console.print(_coloured(finding.verdict.value) + Text(f": {claim.text} ({claim.source})"))
        console.print(Padding(Text(f"measured: {finding.measured}"), (0, 0, 0, 2), expand=False))
        if finding.why:
            console.print(Padding(Text(f"why: {finding.why}"), (0, 0, 0, 2), expand=False))
    for table in section.tables:
        _print_table(console, table)
    if failed:
        console.print()
        console.print(Text(f"{len(failed)} of {len(results.rows)} points failed:", style="bold"))
    for row in failed:
        console.print(Padding(Text(f"{point_line(row.point)}: {row.error}"), (0, 0, 0, 2), expand=False))


def print_verdicts(console: Console, rows: Sequence[Judgement]) -> None:
    """Print the claims with their verdicts, the claims that were not measured, and the number that agree."""
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, expand=True)
    grid.add_column("verdict", no_wrap=True)
    grid.add_column("claim", ratio=1)
    grid.add_column("measured", ratio=1)
    chapter = ""
    for each in (each for each in rows if each.findings):
        if each.chapter != chapter:
            grid.add_section()
            chapter = each.chapter
        measured = "\n".join(finding.measured for _, finding in each.findings)
        claim = Text(each.claim.text) + Text(f" ({each.claim.source})", style="dim")
        grid.add_row(_coloured(each.outcome), claim, Text(measured))
    console.print()
    if grid.row_count:
        console.print(grid)
    missing = ", ".join(each.key for each in rows if not each.findings)
    if missing:
        console.print()
        console.print(_coloured(NOT_MEASURED) + Text(f": {missing}"))
    console.print()
    for kind, numbers in counts(rows).items():
        words = [Text(in_words(name, number), style=COLOURS[name]) for name, number in numbers.items()]
        console.print(Text(f"{sum(numbers.values())} {kind}: ") + Text(", ").join(words))


def _coloured(outcome: str) -> Text:
    return Text.assemble((outcome, f"bold {COLOURS[outcome]}"))


def _print_table(console: Console, table: Table) -> None:
    """Print a table. A table that is too wide is printed in several parts, each with the first column."""
    shown = table.rows[:MOST_ROWS]
    cells = [[readable(value) for value in row] for row in shown]
    right = numeric_columns(table.rows, len(table.columns))
    console.print()
    console.print(Text(table.title, style="bold"))
    for part in _parts(table.columns, cells, console.width):
        grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for k in part:
            grid.add_column(
                Text(table.columns[k]), justify="right" if right[k] else "left", vertical="bottom"
            )
        for row in cells:
            grid.add_row(*(Text(row[k]) for k in part))
        console.print(grid)
    if len(table.rows) > MOST_ROWS:
        console.print(Text(f"and {len(table.rows) - MOST_ROWS} more rows", style="dim"))


def _parts(columns: Sequence[str], cells: Sequence[Sequence[str]], width: int) -> Iterator[list[int]]:
    """Yield groups of column indices that fit side by side if only headings and long cells are wrapped."""
    needed = [
        BETWEEN
        + min(WIDEST, max(len(word) for word in [*columns[k].split(), *(row[k] for row in cells), ""]))
        for k in range(len(columns))
    ]
    part: list[int] = []
    for k in range(len(columns)):
        if len(part) > 1 and sum(needed[j] for j in part) + needed[k] > width:
            yield part
            part = [0]
        part.append(k)
    yield part
