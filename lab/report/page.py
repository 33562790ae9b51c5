"""Write the report: a self-contained HTML page, the same page in Markdown, and all numbers as CSV."""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from lab.experiments import CLAIMS, Effort
from lab.extras import require_report
from lab.report.exhibits import Exhibit, Sheet, exhibit_of, file_name, require_distinct, sheet_of
from lab.report.judgements import Concluded, Judgement, counts, in_words, judge
from lab.report.law_checks import law_table
from lab.report.markdown import Literal, escaped
from lab.report.spreadsheets import csv_of_judgements
from lab.report.wording import duration, point_line
from taichi_soft.core.errors import OptionError

TEMPLATES = Path(__file__).parent / "templates"


def write_report(
    sections: Sequence[Concluded], directory: Path, command: str, effort: Effort, facts: dict[str, str]
) -> Path:
    """Write the report, with the sections in the given order.

    Args:
        sections: experiments with their results and sections.
        directory: folder for `report.html`, `report.md`, `verdicts.csv` and the folders `plots`, `pictures`,
            `tables` and `points`. A missing folder is created. Other files in the folder stay.
        command: command line that repeats this report.
        effort: extent of the report.
        facts: names and values of the machine and of versions.
    Returns: the path of `report.html`, which needs no other file.
    Raises: OptionError if the extra `lab` is missing, for duplicate names, findings on unknown claims, rows
        or images of a wrong shape, or a folder that cannot be written. Existing files then stay unchanged.
    """
    require_report()
    require_distinct((experiment.name for experiment, _, _ in sections), "the report")
    judgements = judge(sections)
    exhibits = [exhibit_of(*section) for section in sections]
    laws = law_table(sections)
    sheets = [sheet_of(laws, "tables/laws.csv")] if laws else []
    files = _data_files(exhibits, judgements, sheets)
    values: dict[str, Any] = {
        "claims": CLAIMS,
        "judgements": judgements,
        "chapters": list(dict.fromkeys(each.chapter for each in judgements)),
        "counts": counts(judgements),
        "exhibits": exhibits,
        "sheets": sheets,
        "seconds": sum(each.seconds for each in exhibits),
        "date": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        "command": command,
        "effort": effort,
        "facts": facts,
    }
    for name in ("report.md", "report.html"):
        files[name] = _filled(name, values).encode("utf-8", "backslashreplace")
    _replace(directory, files)
    return directory / "report.html"


def _filled(name: str, values: dict[str, Any]) -> str:
    """Fill a template with values, each escaped for the format."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    is_html = name.endswith(".html")
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=is_html,
        finalize=None if is_html else escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(
        duration=duration, point_line=point_line, file_name=file_name, in_words=in_words, raw=Literal
    )
    return environment.get_template(name).render(values)


def _data_files(
    exhibits: Sequence[Exhibit], judgements: Sequence[Judgement], sheets: Sequence[Sheet]
) -> dict[str, bytes]:
    """Return the contents of all files except the pages, by path in the folder."""
    texts = {"verdicts.csv": csv_of_judgements(judgements)} | {sheet.path: sheet.csv for sheet in sheets}
    files: dict[str, bytes] = {}
    for each in exhibits:
        texts[each.points_path] = each.points_csv
        texts.update((sheet.path, sheet.csv) for sheet in each.sheets)
        files.update((image.path, image.png) for image in (*each.plots, *each.pictures) if image.png)
    return files | {path: text.encode("utf-8", "backslashreplace") for path, text in texts.items()}


def _replace(directory: Path, files: dict[str, bytes]) -> None:
    """Write all files under temporary names, and rename them when all are complete."""
    parts: dict[Path, Path] = {}
    try:
        for path, data in files.items():
            target = directory / path
            target.parent.mkdir(parents=True, exist_ok=True)
            parts[target] = target.with_name(f".{target.name}.part")
            parts[target].write_bytes(data)
        for target, part in parts.items():  # the pages are the last files
            os.replace(part, target)
    except OSError as error:
        raise OptionError(f"cannot write the report to {directory}: {error.strerror or error}") from error
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)
