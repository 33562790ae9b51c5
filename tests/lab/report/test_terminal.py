"""Sections and verdicts on a terminal of 80 columns. The contents are made up."""

import io

import invented_sections as invented
import pytest
from rich.console import Console

from lab.experiments import CLAIMS
from lab.report.judgements import judge
from lab.report.terminal import print_section, print_verdicts

pytestmark = [pytest.mark.soak, pytest.mark.needs("lab")]


def printed(show, *arguments, **options):
    """Return the lines that a function prints, 80 columns wide."""
    file = io.StringIO()
    show(Console(file=file, width=80, **options), *arguments)
    return file.getvalue().splitlines()


def words_of(lines):
    return " ".join(" ".join(lines).split())


@pytest.mark.parametrize("section", invented.INVENTED, ids=lambda section: section[0].name)
def test_no_line_is_wider_than_the_terminal(section):
    assert max(map(len, printed(print_section, *section))) <= 80


def test_a_section_tells_what_was_found_why_and_what_failed():
    words = words_of(printed(print_section, *invented.INVENTED[0]))
    assert words.startswith("Tension of a cylinder figure 6.4, 7 points, 1 failed, 2 s of computing")
    assert invented.TENSION_SECTION.text[1] in words
    for finding in invented.TENSION_SECTION.findings:
        claim = CLAIMS[finding.claim]
        assert f"{finding.verdict.value}: {claim.text} ({claim.source}) measured: {finding.measured}" in words
        assert finding.why in words
    assert "1 of 7 points failed: poisson = 0.5, strain = 0.1: OptionError" in words


def test_tables_keep_their_numbers_whole():
    lines = printed(print_section, *invented.INVENTED[0])
    assert any(line.split() == ["0.2", "1.1e6", "1.1", "no", "–"] for line in lines)
    assert "and 20 more rows" in lines
    first = next(k for k, line in enumerate(lines) if line == "Many columns")
    wide = [line.split() for line in lines[first:] if line.split() and line.split()[0] == "0"]
    assert len(wide) == 2  # two parts, each with the first column
    assert [number for part in wide for number in part[1:]] == [str(k) for k in range(1, 14)]


def test_any_text_is_printed_as_it_is():
    hostile = "[bold red]x[/] [/nothing] \\[ :smile:"
    experiment = invented.experiment("trap", hostile, hostile)
    section = invented.Section((hostile,), (), (invented.Table("t", hostile, (hostile,), ((hostile,),)),))
    results = invented.Results((invented.Result({hostile: hostile}, None, hostile),))
    words = words_of(printed(print_section, experiment, results, section))
    assert words.count(hostile) == 9


def test_verdicts_list_what_was_found_and_count_all():
    judgements = judge(invented.INVENTED)
    lines = printed(print_verdicts, judgements)
    assert max(map(len, lines)) <= 80
    found = [line for line in lines if line.startswith(("differs", "agrees", "cannot be told"))]
    assert [line.split("  ")[0] for line in found] == [
        "differs",
        "differs",
        "cannot be told",
        "cannot be told",
    ]
    words = words_of(lines)
    missing = [key for key in CLAIMS if key not in invented.EXPECTED]
    assert f"not measured: {', '.join(missing)}" in words
    assert words.endswith(" ".join(f"{kind}: {line}" for kind, line in invented.COUNTS.items()))


def test_verdicts_are_coloured_where_the_terminal_has_colours():
    judgements = judge(invented.INVENTED)
    text = "\n".join(printed(print_verdicts, judgements, force_terminal=True, color_system="truecolor"))
    assert "\x1b[" in text
    assert "\x1b[" not in "\n".join(printed(print_verdicts, judgements))
