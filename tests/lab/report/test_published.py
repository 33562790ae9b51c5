"""The report in docs/report, and what the README tells of it, against what the code says of the same numbers.

Nothing is measured anew: the published points are concluded again.
"""

import csv
import json
from pathlib import Path

import pytest

from lab.experiments import CLAIMS, EXPERIMENTS, Effort, Result, Results, Verdict, section_of
from lab.report.markdown import escaped
from lab.report.wording import legible

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]

ROOT = Path(__file__).resolve().parents[3]
REPORT = ROOT / "docs" / "report"
MANY = {
    Verdict.AGREES: ("agrees", "agree"),
    Verdict.PARTLY: ("agrees in part", "agree in part"),
    Verdict.DIFFERS: ("differs", "differ"),
    Verdict.UNKNOWN: ("cannot be told", "cannot be told"),
}
"""Words for one claim, and for several."""
THEORY = "Beyond the thesis: theory"


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def cell(value) -> str:
    """Return a value as the files contain it."""
    if value is None:
        return ""
    return value if isinstance(value, str) else json.dumps(value)


def value(text: str):
    try:
        return json.loads(text)
    except ValueError:
        return text


def published(experiment) -> Results:
    """The published points, which are those that the code asks for today, with what was measured there."""
    csv.field_size_limit(2**30)
    rows = rows_of(REPORT / "points" / f"{experiment.name}.csv")
    points = experiment.points(Effort.FULL)
    assert len(rows) == len(points)
    results = []
    for row, point in zip(rows, points, strict=True):
        told = {name.removeprefix("point."): text for name, text in row.items() if name.startswith("point.")}
        assert {name: cell(point.get(name)) for name in told} == told
        assert set(point) <= set(told)
        numbers = {
            name.removeprefix("measured."): value(text)
            for name, text in row.items()
            if name.startswith("measured.") and text
        }
        assert row["error"] == ""
        results.append(Result(point, numbers, seconds=float(row["seconds"])))
    return Results(tuple(results))


VERDICTS = rows_of(REPORT / "verdicts.csv")


def test_the_published_claims_are_those_of_the_code_in_their_order_and_words():
    told = [(row["claim"], row["source"], row["text"]) for row in VERDICTS]
    assert told == [(key, claim.source, claim.text) for key, claim in CLAIMS.items()]
    assert {path.stem for path in (REPORT / "points").iterdir()} == set(EXPERIMENTS)


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_published_verdicts_and_reasons_follow_from_the_published_points(name):
    experiment = EXPERIMENTS[name]
    found = {
        (finding.claim, finding.verdict.value, legible(finding.measured), legible(finding.why))
        for finding in section_of(experiment, published(experiment)).findings
    }
    told = {
        (row["claim"], row["verdict"], row["measured"], row["why"])
        for row in VERDICTS
        if row["experiment"] == name
    }
    assert found == told
    assert {claim for claim, *_ in told} == set(experiment.claims)


def counted(is_theory: bool) -> tuple[int, list[str]]:
    """Return the number of claims or statements, and the number with each verdict, in words."""
    rows = [row for row in VERDICTS if (row["chapter"] == THEORY) is is_theory]
    counts = {verdict: sum(row["verdict"] == verdict.value for row in rows) for verdict in Verdict}
    assert sum(counts.values()) == len(rows)
    return len(rows), [f"{count} {MANY[verdict][count != 1]}" for verdict, count in counts.items()]


def test_report_and_readme_count_the_verdicts_of_the_table():
    report = (REPORT / "report.md").read_text(encoding="utf-8")
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for is_theory, kind in ((False, "claims of the thesis"), (True, "statements of theory")):
        number, words = counted(is_theory)
        assert f"\nOf {number} {kind}: {', '.join(words)}, 0 not measured.\n" in report
        told = [each for each in words if not each.startswith("0 ")]
        assert f"of {number} {kind} {', '.join(told[:-1])} and {told[-1]}" in readme
    assert counted(False)[0] + counted(True)[0] == len(CLAIMS)


def test_the_report_tells_every_verdict_of_the_table():
    report = (REPORT / "report.md").read_text(encoding="utf-8")
    for row in VERDICTS:
        told = f"| **{row['verdict']}** | {escaped(row['text'])} | {escaped(row['source'])} | "
        assert f"{told}{escaped(row['measured'])}" in report, row["claim"]
